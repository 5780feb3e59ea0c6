import { expect, test } from "vitest";
import { renderTown } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./testBed";
import type { Global } from "./page";

const bed = new TestBed({ town: renderTown() }, { draws: false });

test("a rendering that is missing is one error that says what to do; promises reject with it, whenReady does not call, and another rendering can follow", async () => {
  const { page } = await bed.bare();
  const told = await page.evaluate(
    async ([missing, url, at]) => {
      const { map3d } = globalThis as Global;
      const map = new map3d.map("mapcanvas");
      const errors: Error[] = [];
      let ready = 0;
      const first = new Promise((done) => map.on("error", ({ error }) => done(errors.push(error))));
      map.whenReady(() => {
        ready++;
      });
      // On the ground: it waits for the rendering, as findPosition does.
      const marker = new map3d.marker("Tower", { xy: [at[0], at[1]], height: "ground" }).addTo(map);
      const layer = new map3d.imageLayer(missing).addTo(map);
      const outcome = (found: Promise<unknown>): Promise<string> =>
        found.then(
          () => "found",
          (error: unknown) => String(error),
        );
      const early = outcome(map.findPosition({ xy: [at[0], at[1]], height: "ground" }));
      await first;
      const rejected = [await early, await outcome(map.findPosition({ object: 17 }))];
      await new Promise((done) => setTimeout(done, 100));
      const before = {
        errors: errors.map(String),
        rejected,
        ready,
        loaded: map.loaded(),
        picked: (await map.pick([50, 50])).id,
        inView: (await map.objectsInView()).length,
      };
      // Another one in its place.
      map.removeLayer(layer).addLayer(new map3d.imageLayer(url));
      const found = await map.findPosition({ xy: [at[0], at[1]], height: 503 });
      marker.setPosition({ xy: [at[0], at[1]], height: "ground" });
      await new Promise((done) => map.once("idle", done));
      return { ...before, found, after: { ready, loaded: map.loaded(), errors: errors.length } };
    },
    [bed.url("nowhere"), bed.url("town"), ORIGIN] as const,
  );
  const message = `FetchError: ${bed.url("nowhere")}/rendering.json: HTTP 404; pass the URL of its folder`;
  expect(told).toEqual({
    errors: [message],
    rejected: [message, message],
    ready: 0,
    loaded: false,
    picked: 0,
    inView: 0,
    found: [ORIGIN[0], ORIGIN[1], 503],
    after: { ready: 1, loaded: true, errors: 1 },
  });
});

test("without a listener, the console has the message, once", async () => {
  const { page } = await bed.bare();
  const warnings: string[] = [];
  page.on("console", (message) => {
    if (message.type() === "warning") warnings.push(message.text());
  });
  await page.evaluate(async (url) => {
    const { map3d } = globalThis as Global;
    const map = new map3d.map("mapcanvas");
    const layer = new map3d.imageLayer(url).addTo(map);
    await new Promise((done) => layer.once("error", done));
    await new Promise((done) => setTimeout(done, 100));
  }, bed.url("nowhere"));
  expect(warnings).toEqual([`map3d: ${bed.url("nowhere")}/rendering.json: HTTP 404; pass the URL of its folder`]);
});

import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import { renderTown } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { decoded, settled, type Global } from "./page";

const town = renderTown();
const bed = new TestBed({ town, later: town });
const QUIET = { drawer: "canvas", zoom: 3, controls: false, attribution: false };

type Counting = Global & { counts: { puts: number; draws: number } };

/** Starts to count draw calls on the page's canvases. */
function count(): void {
  const g = globalThis as Counting;
  g.counts = { puts: 0, draws: 0 };
  const own = CanvasRenderingContext2D.prototype;
  const [put, draw] = (["putImageData", "drawImage"] as const).map(
    (name) => Object.getOwnPropertyDescriptor(own, name)?.value as (this: CanvasRenderingContext2D, ...given: unknown[]) => void,
  );
  own.putImageData = function (this: CanvasRenderingContext2D, ...given: unknown[]) {
    g.counts.puts++;
    put?.apply(this, given);
  };
  own.drawImage = function (this: CanvasRenderingContext2D, ...given: unknown[]) {
    g.counts.draws++;
    draw?.apply(this, given);
  };
}

/** Returns the draw calls since the last call. */
const counted = (page: Page): Promise<Counting["counts"]> =>
  page.evaluate(() => {
    const g = globalThis as Counting;
    const { counts } = g;
    g.counts = { puts: 0, draws: 0 };
    return counts;
  });

test("unchanged tiles are moved and scaled, not drawn; new light draws each tile once", async () => {
  const { page, problems } = await bed.start("town", { ...QUIET, preserveDrawingBuffer: false });
  await page.evaluate(count);
  await settled(page, () => (globalThis as Global).map.panBy(9, -6), null);
  await settled(page, () => (globalThis as Global).map.setZoom(3.2), null);
  expect(await counted(page)).toEqual({ puts: 0, draws: 0 });
  const tiles = await page.evaluate(() => document.querySelectorAll(".map3d-mosaics canvas").length);
  expect(tiles).toBe(1);
  await settled(page, () => (globalThis as Global).map.setLight({ azimuth_deg: 10 }), null);
  const { puts, draws } = await counted(page);
  expect([draws, puts > 4, puts < 60]).toEqual([0, true, true]);
  await settled(page, () => (globalThis as Global).map.panBy(300, 0), null);
  expect((await counted(page)).puts).toBeGreaterThan(2);
  expect(problems).toEqual([]);
});

test("several layers, translucent and clipped, look the same as on a canvas", async () => {
  const shots: Buffer[] = [];
  for (const preserveDrawingBuffer of [true, false]) {
    const { page, problems } = await bed.start(
      "town",
      { ...QUIET, preserveDrawingBuffer },
      {},
      { viewport: { width: 500, height: 400 }, deviceScaleFactor: 2, bypassCSP: true },
    );
    // Page styles that apply to every canvas and block.
    if (!preserveDrawingBuffer)
      await page.addStyleTag({
        content:
          "canvas:not(#mapcanvas) { width: 100%; height: 100%; max-width: 90%; margin: 7px; border: 2px solid red; padding: 3px; opacity: 0.5; transition: transform 1s } .map3d-mosaics, .map3d-mosaics div { margin: 9px; padding: 4px; border: 1px solid; transform: scale(0.9) }",
      });
    await settled(
      page,
      (url) =>
        new (globalThis as Global).map3d.imageLayer(url, { mode: "id", opacity: 0.6, combine: false })
          .addTo((globalThis as Global).map)
          .setClip([0, 0, 0.613, 0.8]),
      bed.url("later"),
    );
    await settled(page, () => (globalThis as Global).map.setZoom(3.37), null);
    shots.push(await page.screenshot({ path: `${OUT}/laid-${String(preserveDrawingBuffer)}.png` }));
    expect(problems).toEqual([]);
    await page.context().close();
  }
  const [painted, laid] = await Promise.all(shots.map((shot) => decoded(shot)));
  let [off, most] = [0, 0];
  painted?.data.forEach((value, k) => {
    const apart = Math.abs(value - (laid?.data[k] ?? 0));
    most = Math.max(most, apart);
    if (apart > 6) off++;
  });
  console.log(`laid beside painted: ${String(off)} of ${String(painted?.data.length)} bytes off by more than 6, at most ${String(most)}`);
  expect(painted?.data.length).toBe(500 * 400 * 4 * 3);
  expect(off / (painted?.data.length ?? 0)).toBeLessThan(0.002); // ids are not mixed: where two meet, the nearest pixel may be the other
});

test("a change of view cross-fades: a copy of the old picture covers the new one", async () => {
  const { page, problems } = await bed.start("town", { ...QUIET, preserveDrawingBuffer: false });
  await page.addScriptTag({ url: `${bed.server.origin}/map3d-orbit.js` });
  const seen = await page.evaluate(
    () =>
      new Promise<readonly (number | boolean)[]>((done) => {
        const g = globalThis as Global & { map3d: { orbit: new () => { addTo(map: unknown): unknown } } };
        new g.map3d.orbit().addTo(g.map);
        g.map
          .once("directionchange", () =>
            requestAnimationFrame(() => {
              const [first, second] = document.querySelectorAll<HTMLElement>(".map3d-mosaics");
              const copy = second?.querySelector("canvas");
              const pixel = copy?.getContext("2d")?.getImageData(copy.width / 2, copy.height / 2, 1, 1).data[3];
              done([document.querySelectorAll(".map3d-mosaics").length, first?.nextElementSibling === second, pixel === 255]);
            }),
          )
          .rotate(1);
      }),
  );
  expect(seen).toEqual([2, true, true]);
  await page.waitForFunction(() => document.querySelectorAll(".map3d-mosaics").length === 1);
  expect(problems).toEqual([]);
});

test("a removed map removes its elements", async () => {
  const { page } = await bed.start("town", { ...QUIET, preserveDrawingBuffer: false });
  expect(await page.locator(".map3d-mosaics").count()).toBe(1);
  await page.evaluate(() => (globalThis as Global).map.remove());
  expect(await page.locator(".map3d-mosaics").count()).toBe(0);
});

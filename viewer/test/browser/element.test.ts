import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Element from "../../src/element";
import { renderTown } from "../fixture/rendering";
import { lonLatFromLocal } from "../../src/geo/geographic";
import { ORIGIN, PLACE } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";

const bed = new TestBed({ town: renderTown() }, { draws: false });
const at = (x: number, y: number, z: number): string => [ORIGIN[0] + x, ORIGIN[1] + y, ORIGIN[2] + z].join(" ");
const HEAD =
  '<!doctype html><html lang="de"><head><meta charset="utf-8"><title>test</title><link rel="icon" href="data:,"><link rel="stylesheet" href="/element.css">';
const SCRIPTS = '<script src="/map3d.js"></script><script src="/map3d-element.js"></script>';
const MAP = `<map-3d id="where" src="tiles/town" direction="90-45" center="${at(32, 26, 30)}" zoom="2" time="2026-06-21T10:00Z" controls="off">
  Unsere Anschrift: Marktplatz 1.
  <map-3d-marker id="hall" position="${at(-45, -4, 34)}" label="Rathaus &lt;b&gt;"><p>Offen bis <b>17 Uhr</b></p>&lt;i&gt;Text</map-3d-marker>
  <map-3d-layer src="tiles/town" mode="normal" opacity="0.5"></map-3d-layer>
</map-3d>`;
bed.server.pages.set("/element.css", "map-3d { height: 400px; width: 600px; } p { margin: 0; color: rgb(1, 2, 3); }");
bed.server.pages.set("/before", `${HEAD}${SCRIPTS}</head><body><main>${MAP}</main></body></html>`);
bed.server.pages.set("/after", `${HEAD}</head><body><main>${MAP}</main>${SCRIPTS}</body></html>`);
bed.server.pages.set(
  "/wrong",
  `${HEAD}</head><body><map-3d src="tiles/nowhere"> Unsere Anschrift: <map-3d-marker position="1 2 3" label="Rathaus">Marktplatz 1</map-3d-marker></map-3d><map-3d src="tiles/nowhere" lang="fr"></map-3d>${SCRIPTS}</body></html>`,
);

bed.server.pages.set(
  "/features",
  `${HEAD}</head><body><map-3d id="where" src="tiles/town" orbit shade zoom="3"><map-3d-marker lonlat="${lonLatFromLocal(PLACE, [-45, -4]).join(" ")}" label="Rathaus"></map-3d-marker>
  <map-3d-marker object="Tower" label="Turm"></map-3d-marker></map-3d>${SCRIPTS}<script src="/map3d-orbit.js"></script></body></html>`,
);

type Where = Element.mapElement;
const where = (): Where => document.getElementById("where") as Where;
/** Functions that run in the page, which cannot access functions of this file. */
const inPage = `globalThis.where = ${where.toString()}; globalThis.rest = () => new Promise((done) => where().addEventListener("map-idle", done, { once: true }));`;
declare const rest: () => Promise<void>;

async function open(path: string): Promise<{ page: Page; problems: string[] }> {
  const opened = await bed.openPage();
  await opened.page.addInitScript({ content: inPage });
  await opened.page.goto(`${bed.server.origin}${path}`);
  return opened;
}

async function openMap(path: string): Promise<{ page: Page; problems: string[] }> {
  const opened = await open(path);
  await opened.page.evaluate(() => rest());
  return opened;
}

test.each(["/before", "/after"])("%s: attributes and children create a map and update it", async (path) => {
  const { page, problems } = await openMap(path);
  const state = await page.evaluate(() => {
    const { map, layers } = where();
    return {
      direction: map?.direction,
      zoom: map?.zoom,
      time: map?.time?.toISOString(),
      center: map?.center?.map(Math.round),
      modes: layers.map((layer) => [layer.mode, layer.options.opacity]),
      label: map?.container.getAttribute("aria-label"),
      buttons: document.querySelectorAll(".map3d-buttons").length,
    };
  });
  expect(state).toMatchObject({
    direction: "90-45",
    zoom: 2,
    time: "2026-06-21T10:00:00.000Z",
    modes: [
      ["lit", 1],
      ["normal", 0.5],
    ],
    label: "Karte",
    buttons: 0,
  });
  await page.locator(".map3d-marker").click();
  const popup = page.locator(".map3d-popup");
  expect(await popup.innerText()).toContain("Offen bis 17 Uhr");
  expect(await popup.innerText()).toContain("<i>Text");
  expect(await popup.locator("p").evaluate((node) => getComputedStyle(node).color)).toBe("rgb(1, 2, 3)");
  expect(await page.locator("map-3d").innerText()).not.toContain("Anschrift");
  await page.screenshot({ path: `${OUT}/element.png` });

  const changed = await page.evaluate(async () => {
    const [element, hall] = [where(), document.getElementById("hall") as Element.markerElement];
    const [map, errors] = [element.map, [] as string[]];
    document.addEventListener("map-error", (event) => {
      event.preventDefault();
      errors.push(event.detail.error.message);
    });
    for (const [name, value] of Object.entries({ direction: "180-45", zoom: "3", mode: "depth", light: "90 20" }))
      element.setAttribute(name, value);
    for (const [name, value] of [
      ["center", "here"],
      ["zoom", "1 2"],
      ["direction", "7-7"],
      ["mode", "pretty"],
      ["time", "noon"],
    ] as const)
      element.setAttribute(name, value);
    hall.setAttribute("label", "Hall");
    hall.setAttribute("position", "1 2");
    const added = document.createElement("map-3d-marker");
    element.append(added);
    added.setAttribute("position", "691032 5336026 562");
    added.setAttribute("label", "Turm");
    await rest();
    return {
      same: map === element.map,
      direction: map?.direction,
      zoom: map?.zoom,
      time: map?.time,
      azimuth: map?.light.azimuth_deg,
      mode: element.layers[0]?.mode,
      errors,
      labels: [...document.querySelectorAll(".map3d-marker")].map((node) => node.textContent),
    };
  });
  expect(changed).toMatchObject({
    same: true,
    direction: "180-45",
    zoom: 3,
    time: null,
    azimuth: 90,
    mode: "depth",
    labels: ["Hall", "Turm"],
  });
  expect(changed.errors).toEqual([
    '<map-3d center="here">: center must be three numbers such as "691000 5336000 520"',
    '<map-3d zoom="1 2">: zoom must be a number',
    'unknown view "7-7"; the rendering has 0-45, 90-45, 180-45, 270-45',
    'unknown mode "pretty"; use one of lit, color, picture, normal, id, depth',
    '<map-3d time="noon">: time must be a time such as "2026-06-21T14:00Z", or "now"',
    '<map-3d-marker position="1 2">: position must be three numbers such as "691000 5336000 520"',
  ]);
  expect(problems).toEqual([]);
});

test("events bubble as map-…; removing the element removes the map, inserting it again restores the view", async () => {
  const { page, problems } = await openMap("/after");
  await page.addScriptTag({ url: "/map3d-element.js" }); // a second time
  await page.addScriptTag({ url: "/map3d-full.js" });
  await page.evaluate(() => {
    where().map?.setView([691032, 5336026, 562], 3).setTime(new Date("2026-12-21T11:00Z"));
  });
  const clicked = page.evaluate(
    () =>
      new Promise<unknown>((done) => {
        document.body.addEventListener(
          "map-click",
          ({ detail }) => {
            done([detail.id, detail.name, detail.attributes?.["measuredHeight"]]);
          },
          { once: true },
        );
      }),
  );
  await page.mouse.click(308, 208);
  expect(await clicked).toEqual([2_000_000_001, "Tower", 62]);
  const [before, away, back] = await page.evaluate(async () => {
    const [element, main] = [where(), document.querySelector("main") as HTMLElement];
    const state = (): object => ({
      direction: element.map?.direction,
      zoom: element.map?.zoom,
      time: element.map?.time,
      layers: element.layers.length,
      at: element.map?.project([691032, 5336026, 562]),
    });
    const before = state();
    const map = element.map;
    document.body.append(element); // put elsewhere: it stays as it is
    await Promise.resolve();
    const stays = map === element.map;
    element.remove();
    await Promise.resolve();
    const away = [
      stays,
      element.map,
      element.layers.length,
      element.querySelectorAll("canvas").length,
      document.getElementById("hall")?.textContent ?? element.querySelector("#hall")?.textContent,
    ];
    main.append(element);
    await rest();
    return [before, away, state()] as const;
  });
  expect(away).toEqual([true, null, 0, 0, "Offen bis 17 Uhr<i>Text"]);
  const [from, to] = [before, back].map((state) => (state as { at: readonly [number, number] }).at) as [[number, number], [number, number]];
  expect(back).toEqual({ ...before, at: to });
  expect(Math.hypot(to[0] - from[0], to[1] - from[1])).toBeLessThan(1); // positions are those of pixels' centres
  await page.locator(".map3d-marker").click({ force: true });
  const language = await page.evaluate(async () => {
    where().setAttribute("language", "en");
    where().removeAttribute("controls");
    await Promise.resolve();
    await rest();
    return [where().map?.zoom, document.querySelector(".map3d-buttons [aria-label='Zoom in']") !== null];
  });
  expect(language).toEqual([3, true]);
  await page.evaluate(() => {
    where().remove();
  });
  await expect.poll(() => page.workers()).toEqual([]);
  expect(problems).toEqual([]);
});

test("without a drawable map the fallback content or a message is shown; another src shows the map", async () => {
  const { page } = await open("/wrong");
  await page.getByText("Unsere Anschrift").waitFor();
  expect(await page.locator("map-3d").first().innerText()).toBe("Unsere Anschrift: Marktplatz 1");
  await page.getByText("Impossible de charger la carte.").waitFor();
  await page.screenshot({ path: `${OUT}/element-none.png` });
  await page.evaluate(
    () =>
      new Promise((done) => {
        const element = document.querySelector("map-3d") as Where;
        element.addEventListener("map-idle", done);
        element.setAttribute("src", "tiles/town");
      }),
  );
  expect(await page.locator("map-3d").first().locator("canvas").isVisible()).toBe(true);
  expect(await page.locator("map-3d").first().innerText()).not.toContain("Anschrift");
  await page.context().close();

  const bare = await bed.openPage();
  await bare.page.addInitScript({
    content: "HTMLCanvasElement.prototype.getContext = () => null; OffscreenCanvas.prototype.getContext = () => null;",
  });
  await bare.page.goto(`${bed.server.origin}/after`);
  await bare.page.getByText("Unsere Anschrift").waitFor();
  expect(await bare.page.locator("map-3d").innerText()).toContain("Offen bis 17 Uhr");
});

test("markers stand at longitude and latitude or on an object; orbit is added, and a missing script is told", async () => {
  const { page, problems } = await open("/features");
  await page.waitForFunction(() => where().map?.markers.every(({ position }) => position) === true && where().map?.markers.length === 2);
  const places = await page.evaluate(() => where().map?.markers.map(({ label, position }) => [label, ...(position ?? [])]) ?? []);
  for (const [label, x, y, z] of [
    ["Rathaus", -45, -4, 34],
    ["Turm", 32, 26, 62],
  ] as const) {
    const [, ...found] = places.find(([name]) => name === label) ?? [];
    [x, y, z].forEach((part, k) => {
      expect(Math.abs(Number(found[k]) - (ORIGIN[k as 0] + part))).toBeLessThan(0.6);
    });
  }
  await page.waitForLoadState("load");
  await expect
    .poll(() => problems.join())
    .toBe('map3d: <map-3d shade> needs the entry shade: load map3d-shade.js after map3d.js, or import "map3d/shade"');
  await page.evaluate(
    () =>
      new Promise((done) => {
        where().map?.once("idle", done).rotate(1);
      }),
  );
  expect(await page.evaluate(() => (where().map as unknown as { transition: unknown }).transition !== null)).toBe(true);
});

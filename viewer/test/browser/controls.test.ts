import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Controls from "../../src/controls";
import { renderTown } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import type { Global } from "./page";
import { drawn, steady } from "./page";

const town = renderTown();
const placeless = { ...town, json: { ...town.json } };
delete placeless.json.geographic;
const bed = new TestBed({ town, placeless }, { draws: false });
type Controlled = Global & { map3d: typeof Controls; control: Controls.locate; overview: Controls.overview };

const START = { zoom: 3, center: [ORIGIN[0], ORIGIN[1], ORIGIN[2]] };
const said = (page: Page, text: string): Promise<unknown> =>
  page.waitForFunction((wanted) => document.querySelector(".map3d-status")?.textContent === wanted, text);

test("the location is shown on the surface with an accuracy circle; denied, outside and missing georeference show messages", async () => {
  const { page, problems } = await bed.start(
    "town",
    { ...START, zoom: 1, language: "de" },
    {},
    { permissions: ["geolocation"], reducedMotion: "reduce" },
  );
  await page.addScriptTag({ url: "/map3d-controls.js" });
  await page.evaluate(() => {
    const g = globalThis as unknown as Controlled;
    g.control = new g.map3d.locate().addTo(g.map);
  });
  const button = page.getByRole("button", { name: "Meinen Standort anzeigen" });
  for (const [x, y, z] of [
    [-80, -60, 0],
    [-45, 0, 34],
    [32, 26, 62],
  ] as const) {
    const [longitude, latitude] = await page.evaluate((world) => (globalThis as Global).map.lonLat(world) as [number, number], [
      ORIGIN[0] + x,
      ORIGIN[1] + y,
      ORIGIN[2],
    ] as const);
    await page.context().setGeolocation({ longitude, latitude, accuracy: 12 });
    await button.click();
    await page.waitForSelector(".map3d-accuracy");
    expect(await page.locator(".map3d-marker").getAttribute("aria-label")).toBe("Sie sind hier (± 12 m)");
    await drawn(page);
    const [center, zoom, circle, wide] = await page.evaluate(() => {
      const { map } = globalThis as Global;
      return [
        map.unproject([400, 300]),
        map.zoom,
        document.querySelector(".map3d-accuracy path")?.getBoundingClientRect().width,
        24 / map.metresPerPixel,
      ] as const;
    });
    // Along the line of sight from the place on the surface to the ground: as much further north as it is lower, at 45 degrees.
    const low = ORIGIN[2] - 2;
    expect(center?.[0]).toBeCloseTo(ORIGIN[0] + x, 0);
    expect((center?.[1] ?? 0) - (ORIGIN[2] + z - low)).toBeCloseTo(ORIGIN[1] + y, -0.3);
    expect(zoom).toBeGreaterThan(1);
    expect(Math.abs((circle ?? 0) - wide)).toBeLessThan(4);
    if (z === 34) await page.screenshot({ path: `${OUT}/locate.png` });
    await button.click();
    expect(await page.locator(".map3d-accuracy, .map3d-marker").count()).toBe(0);
  }
  for (const [longitude, latitude] of [
    [13.4, 52.5],
    [11.6, 48.15],
    [-120, -30],
  ] as const) {
    await page.context().setGeolocation({ longitude, latitude, accuracy: 30 });
    await button.click();
    await said(page, "Ihr Standort liegt außerhalb dieser Karte.");
  }
  await page.context().clearPermissions();
  await button.click();
  await said(page, "Der Zugriff auf Ihren Standort ist blockiert. Erlauben Sie ihn in den Browsereinstellungen für diese Seite.");
  await page.screenshot({ path: `${OUT}/locate-denied.png` });
  await page.evaluate(() => (globalThis as unknown as Controlled).control.remove());
  expect((await button.count()) + (await page.locator(".map3d-status").count())).toBe(0);
  expect(problems).toEqual([]);
  await page.context().close();
  const { page: other } = await bed.start("placeless", START);
  await other.addScriptTag({ url: "/map3d-controls.js" });
  await other.evaluate(() => {
    const g = globalThis as unknown as Controlled;
    new g.map3d.locate().addTo(g.map).toggle();
  });
  await said(other, "Your location can’t be shown, because this map has no geographic coordinates.");
});

/** The frame's middle and size in the small map, and the ground in the large map's middle. */
const stateOf = (page: Page): Promise<{ x: number; y: number; width: number; height: number; at: readonly number[] }> =>
  page.evaluate(() => {
    const [box, frame] = [".map3d-overview-map", ".map3d-overview-frame"].map(
      (name) => document.querySelector(name)?.getBoundingClientRect() as DOMRect,
    ) as [DOMRect, DOMRect];
    const { map } = globalThis as Global;
    const { clientWidth, clientHeight } = map.container;
    return {
      x: frame.x + frame.width / 2 - box.x,
      y: frame.y + frame.height / 2 - box.y,
      width: frame.width,
      height: frame.height,
      at: map.unproject([clientWidth / 2, clientHeight / 2]) ?? [],
    };
  });

test("the overview's frame follows the view, by drag, click and keys; the overview rotates with the map; on phones it starts closed", async () => {
  const { page, problems } = await bed.start("town", { ...START, zoom: 4.5 }, {}, { reducedMotion: "reduce" });
  await page.addScriptTag({ url: "/map3d-controls.js" });
  await page.evaluate(
    () =>
      new Promise<void>((done) => {
        const g = globalThis as unknown as Controlled;
        g.overview = new g.map3d.overview().addTo(g.map);
        const wait = (): void => {
          if (document.querySelector(".map3d-overview-frame")?.getAttribute("style")) done();
          else setTimeout(wait, 50);
        };
        wait();
      }),
  );
  await drawn(page);
  const first = await steady(page, () => stateOf(page));
  await page.screenshot({ path: `${OUT}/overview.png` });
  expect(first.width / first.height).toBeCloseTo(800 / 600, 1);
  const pad = (await page.locator(".map3d-overview-pad").boundingBox()) as { x: number; y: number };
  const small_m = ((await page.evaluate(() => (globalThis as Global).map.metresPerPixel)) * 800) / first.width;
  await page.mouse.move(pad.x + first.x, pad.y + first.y);
  await page.mouse.down();
  await page.mouse.move(pad.x + first.x + 6, pad.y + first.y, { steps: 3 });
  await page.mouse.move(pad.x + first.x + 12, pad.y + first.y - 8, { steps: 3 });
  await page.mouse.up();
  await drawn(page);
  const dragged = await steady(page, () => stateOf(page));
  expect(dragged.x - first.x).toBeCloseTo(12, 0);
  expect(dragged.y - first.y).toBeCloseTo(-8, 0);
  expect((dragged.at[0] ?? 0) - (first.at[0] ?? 0)).toBeCloseTo(12 * small_m, -0.5);
  await page.mouse.click(pad.x + 60, pad.y + 90);
  await expect
    .poll(
      async () => {
        const { x, y } = await stateOf(page);
        return [Math.round(x / 3), Math.round(y / 3)];
      },
      { timeout: 15_000 },
    )
    .toEqual([20, 30]);
  const clicked = await stateOf(page);
  await page.locator(".map3d-overview-pad").focus();
  await page.keyboard.press("ArrowRight");
  await expect.poll(async () => (await stateOf(page)).x, { timeout: 15_000 }).toBeGreaterThan(clicked.x + 3);
  await page.evaluate(() => (globalThis as Global).map.setDirection("90-45"));
  await drawn(page);
  const turned = await steady(page, () => stateOf(page));
  await page.screenshot({ path: `${OUT}/overview-turned.png` });
  expect(turned.width).toBeGreaterThan(8);
  await page.getByRole("button", { name: "Overview map" }).click();
  expect(await page.locator("canvas").count()).toBe(1);
  await page.evaluate(() => (globalThis as unknown as Controlled).overview.remove());
  expect(await page.locator(".map3d-overview-map").count()).toBe(0);
  expect(problems).toEqual([]);
  await page.context().close();
  const { page: phone } = await bed.start("town", START, {}, { viewport: { width: 390, height: 844 }, deviceScaleFactor: 3 });
  await phone.addScriptTag({ url: "/map3d-controls.js" });
  await phone.evaluate(() => {
    const g = globalThis as unknown as Controlled;
    g.overview = new g.map3d.overview().addTo(g.map);
  });
  expect(await phone.locator("canvas").count()).toBe(1);
  expect(await phone.getByRole("button", { name: "Overview map" }).getAttribute("aria-expanded")).toBe("false");
});

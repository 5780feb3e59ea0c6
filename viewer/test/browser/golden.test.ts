import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { expect, test } from "vitest";
import type { BrowserContextOptions, Page } from "playwright-core";
import type * as Controls from "../../src/controls";
import type * as Theme from "../../src/theme";
import { decodePng } from "../../src/core/png";
import { renderTown } from "../fixture/rendering";
import { differ, compareWithGolden, TOLERANCE } from "../fixture/golden";
import { ORIGIN, type Place } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { settled, type Global } from "./page";

const GOLDEN = resolve(import.meta.dirname, "../golden");
const PLAN: Place = {
  name: "plan",
  origin: [ORIGIN[0] + 13.7, ORIGIN[1] - 8.3, ORIGIN[2] + 1.5],
  box: [
    [-130, -30, -3],
    [20, 40, 30],
  ],
  things: [
    {
      id: 77,
      name: "Planned house",
      box: [
        [-130, -20, -3],
        [6, 30, 26],
      ],
      wall: [240, 120, 30],
      roof: [250, 60, 60],
    },
  ],
};
const bed = new TestBed({ town: renderTown(), plan: renderTown(128, 0.29, PLAN) }, { way: "exact" });

const NOW = new Date("2026-06-21T11:00:00Z");
const STILL: BrowserContextOptions = { reducedMotion: "reduce", locale: "en-GB", timezoneId: "Europe/Berlin" };
const WIDE = { viewport: { width: 480, height: 320 } };
const LOW = { azimuth_deg: 250, elevation_deg: 12, sun_rgb: [1, 0.7, 0.45], sky_rgb: [0.6, 0.7, 1] };
const [HALL, CHAPEL] = [17, 3_900_000_007];
const places = { hall: [ORIGIN[0] - 45, ORIGIN[1] - 4, ORIGIN[2] + 34], tower: [ORIGIN[0] + 32, ORIGIN[1] + 26, ORIGIN[2] + 62] } as const;

/** Takes a screenshot once two in a row are equal. */
async function restingShot(page: Page): Promise<Buffer> {
  let before: Buffer = Buffer.alloc(0);
  for (let left = 40; left > 0; left--) {
    const shot = await page.screenshot({ animations: "disabled", caret: "hide" });
    if (shot.equals(before)) return shot;
    before = shot;
    await page.waitForTimeout(250);
  }
  throw new Error("the page does not come to rest");
}

/** A map in the bare page. */
interface Scene {
  readonly map?: object;
  readonly layer?: object;
  readonly context?: BrowserContextOptions;
  readonly act?: (page: Page) => Promise<unknown>;
}

const scenes: Record<string, Scene> = {
  day: {},
  "low-sun": { map: { light: LOW } },
  night: { act: (page) => settled(page, () => (globalThis as Global).map.setTime(new Date("2026-06-21T22:30:00Z")), null) },
  color: { layer: { mode: "color" }, map: { direction: "180-45" } },
  ids: { layer: { mode: "id" } },
  highlight: { act: (page) => settled(page, (ids) => (globalThis as Global).layer.highlight(ids), [HALL, CHAPEL]) },
  "two-layers": {
    act: (page) =>
      settled(page, (url) => new (globalThis as Global).map3d.imageLayer(url).addTo((globalThis as Global).map), bed.url("plan")),
  },
  canvas: { map: { drawer: "canvas", zoom: 2.6, light: LOW } },
  dark: { context: { colorScheme: "dark" } },
  marker: { act: markers },
  theme: { act: theme },
  overview: { map: { zoom: 4 }, context: { viewport: { width: 720, height: 480 } }, act: overview },
};

function markers(page: Page): Promise<unknown> {
  return page.evaluate(({ hall, tower }) => {
    const { map, map3d } = globalThis as Global;
    new map3d.marker("Tower", tower).addTo(map);
    new map3d.marker("Town hall", hall).bindPopup("Open till five").addTo(map).select().openPopup();
  }, places);
}

async function theme(page: Page): Promise<void> {
  await page.addScriptTag({ url: "/map3d-theme.js" });
  await page.evaluate(
    () =>
      new Promise<void>((done) => {
        const g = globalThis as Global & { map3d: typeof Theme };
        new g.map3d.theme(g.layer, "measuredHeight", { language: "en" }).addTo(g.map).once("ready", () => {
          g.map.once("idle", () => {
            done();
          });
        });
      }),
  );
}

async function overview(page: Page): Promise<void> {
  await page.addScriptTag({ url: "/map3d-controls.js" });
  await page.evaluate(() => {
    const g = globalThis as Global & { map3d: typeof Controls };
    new g.map3d.overview().addTo(g.map);
  });
  await page.waitForSelector(".map3d-overview-frame[style]");
}

test.each(Object.entries(scenes))("%s", async (name, { map = {}, layer = {}, context = {}, act }) => {
  const { page, problems } = await bed.start("town", { zoom: 2.9, language: "en", ...map }, layer, { ...STILL, ...WIDE, ...context });
  await act?.(page);
  expect(await compareWithGolden(name, await restingShot(page), OUT)).toEqual({ ok: true, why: "" });
  expect(problems).toEqual([]);
});

/** The ready-made page, at a fixed time. */
const pages: Record<string, { context: BrowserContextOptions; act: (page: Page) => Promise<unknown> }> = {
  "page-phone": {
    context: { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true },
    act: (page) => page.touchscreen.tap(150, 420).then(() => page.waitForSelector("#info:not([hidden])")),
  },
  "page-picture": { context: { viewport: { width: 720, height: 520 } }, act: (page) => page.locator("#make-picture").click() },
};

test.each(Object.entries(pages))("%s", async (name, { context, act }) => {
  const { page, problems } = await bed.openPage({ ...STILL, ...context });
  await page.clock.setFixedTime(NOW);
  await page.goto(`${bed.server.origin}/?rendering=${bed.url("town")}`);
  await page.waitForFunction(() => location.hash.length > 5);
  await restingShot(page);
  await act(page);
  expect(await compareWithGolden(name, await restingShot(page), OUT)).toEqual({ ok: true, why: "" });
  expect(problems).toEqual([]);
});

test("a golden picture differs from another scene and from itself shifted by a pixel", async () => {
  const read = (name: string): ReturnType<typeof decodePng> => decodePng(new Uint8Array(readFileSync(`${GOLDEN}/${name}.png`)));
  const [day, marker, dark] = [await read("day"), await read("marker"), await read("dark")];
  const beside = { ...day, data: new Uint8Array(day.data) };
  beside.data.copyWithin(day.channels, 0);
  expect(differ(day, day).share).toBe(0);
  for (const other of [marker, dark, beside]) expect(differ(day, other).share).toBeGreaterThan(20 * TOLERANCE.share);
});

import { writeFileSync } from "node:fs";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { OUT } from "../browser/browser";
import { serve } from "../browser/testBed";
import { begin, type Global } from "../browser/page";
import { renderLater } from "../fixture/secondEpoch";
import { renderNoise, renderTown } from "../fixture/rendering";
import { ORIGIN, type Place } from "../fixture/town";
import { OTHER_BROWSERS } from "./browsers";
import { Chromium } from "./chromium";
import { Display } from "./display";
import type { Driver, Screenshot } from "./driver";
import { HEIGHT, WIDTH, watchedPage, type Watched } from "./page";
import { difference, takeScreenshots } from "./scenes";

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
const [town, noise] = [renderTown(), renderNoise(11)];
const server = serve({ town, noise, later: renderLater(), plan: renderTown(128, 0.29, PLAN) });
watchedPage(server);
const url = (name: string): string => `${server.origin}/tiles/${name}`;

const DRAWERS = ["webgl", "canvas"] as const;
const BARE = { zoom: 3, controls: false, attribution: false, pixelRatio: 1 };
const inTown = (x: number, y: number, z: number): [number, number, number] => [ORIGIN[0] + x, ORIGIN[1] + y, ORIGIN[2] + z];
const ROOF = inTown(-45, -4, 34);

/** Variables of the examples' pages. */
declare const maps: readonly Global["map"][];
declare const map: Global["map"];
declare const before: Global["layer"];
declare const after: Global["layer"];
declare const right: Global["map"];

/** A page with a map at rest. */
async function started(driver: Driver, rendering: string, options: object): Promise<void> {
  await driver.open(`${server.origin}/watched`);
  await driver.evaluate(begin, [url(rendering), { ...BARE, ...options }, {}] as const);
}

const told = (driver: Driver): Promise<string[]> =>
  driver.evaluate(() => [...(globalThis as Watched).problems, ...(globalThis as Global).errors], null);
const at = (driver: Driver, world: readonly [number, number, number]): Promise<[number, number]> =>
  driver.evaluate((point) => (globalThis as Global).map.project(point) as [number, number], world);

/** Chromium's pictures by drawer. */
const wanted = new Map<string, Map<string, Screenshot>>();
let display: Display | undefined;

beforeAll(async () => {
  for (const { name, missing } of OTHER_BROWSERS) if (missing !== null) console.warn(`not tested in ${name}: ${missing}`);
  if (OTHER_BROWSERS.every(({ missing }) => missing !== null)) return;
  display = await Display.open();
  const chromium = await Chromium.start();
  for (const drawer of DRAWERS) {
    await started(chromium, "town", { drawer });
    wanted.set(drawer, await takeScreenshots(chromium, url("plan")));
  }
  await chromium.close();
});
afterAll(() => display?.close());

for (const { name, perturbs, start, missing } of OTHER_BROWSERS) {
  describe.skipIf(missing !== null)(name, () => {
    let driver: Awaited<ReturnType<typeof start>> | undefined;
    const its = (): NonNullable<typeof driver> => driver as NonNullable<typeof driver>;
    const complaints = async (): Promise<string[]> => [...(await told(its())), ...its().complaints];
    beforeAll(async () => {
      driver = await start(display as Display);
    });
    afterAll(() => driver?.close());

    test.each(DRAWERS)("%s: pictures match Chromium's", async (drawer) => {
      await started(its(), "town", { drawer });
      expect(await its().evaluate(() => (globalThis as Global).map.drawer, null)).toBe(drawer);
      for (const [scene, shot] of await takeScreenshots(its(), url("plan"))) {
        writeFileSync(`${OUT}/${name.toLowerCase().replaceAll(" ", "-")}-${drawer}-${scene.replaceAll(" ", "-")}.png`, shot.png);
        const found = difference(shot, wanted.get(drawer)?.get(scene) as Screenshot);
        const { most, off } = TOLERANCE[drawer === "webgl" ? "webgl" : toleranceOf(scene, perturbs)];
        expect(found.most, scene).toBeLessThanOrEqual(most);
        expect(found.off, scene).toBeLessThanOrEqual(off);
      }
      expect(await complaints()).toEqual([]);
    });

    test("ids and depths arrive bit for bit", async () => {
      await started(its(), "noise", {});
      const got = await its().evaluate(async () => {
        const { layer } = globalThis as Global;
        const [view, store] = [layer.rendering?.views.get("0-45"), layer.tiles];
        const values = async (kind: string): Promise<number[]> => {
          const info = layer.rendering?.layers.get(kind);
          const data = view && store && info ? await store.fetch(view, info, { z: 0, x: 0, y: 0 }) : null;
          return data && "values" in data ? [...data.values] : [];
        };
        return { ids: await values("id"), depths: await values("depth") };
      }, null);
      expect(got.ids.length).toBe(64 * 64);
      expect(got.ids.findIndex((id, k) => id !== noise.ids[k])).toBe(-1);
      expect(got.depths.findIndex((depth, k) => depth !== noise.depths[k])).toBe(-1);
    });

    test.skipIf(!perturbs)("pixels read from a canvas differ from those drawn, or the test would be void", async () => {
      const same = await its().evaluate(() => {
        const context = new OffscreenCanvas(64, 64).getContext("2d") as OffscreenCanvasRenderingContext2D;
        const drawn = new ImageData(
          Uint8ClampedArray.from({ length: 4 * 64 * 64 }, (_, k) => (k % 4 === 3 ? 255 : (k * 37) & 255)),
          64,
          64,
        );
        context.putImageData(drawn, 0, 0);
        return context.getImageData(0, 0, 64, 64).data.every((byte, k) => byte === drawn.data[k]);
      }, null);
      expect(same).toBe(false);
    });

    test.each(DRAWERS)("%s: mouse and keys move the map; a click picks", async (drawer) => {
      await started(its(), "town", { drawer, zoom: 2 });
      const first = await at(its(), ROOF);
      await its().drag(first, [60, -40]);
      const dragged = await at(its(), ROOF);
      expect(dragged[0] - first[0]).toBeCloseTo(60, -0.3);
      expect(dragged[1] - first[1]).toBeCloseTo(-40, -0.3);
      await its().wheel(dragged, -240);
      await its().until(() => (globalThis as Global).map.zoom > 2.5, null);
      await its().until(
        (before) => Math.abs((globalThis as Global).map.zoom - before) < 1,
        await its().evaluate(() => (globalThis as Global).map.zoom, null),
      );
      const zoomed = await at(its(), ROOF);
      expect(Math.hypot(zoomed[0] - dragged[0], zoomed[1] - dragged[1])).toBeLessThan(3);
      await its().click(zoomed);
      await its().until(() => (globalThis as Global).clicks.length > 0, null);
      const click = await its().evaluate(
        () =>
          (({ id, position, approximate, name: said }) => ({ id, position, approximate, said }))(
            (globalThis as Global).clicks[0] as Global["clicks"][0],
          ),
        null,
      );
      expect(click).toMatchObject({ id: 17, approximate: false, said: "Town hall" });
      expect(click.position?.[2]).toBeCloseTo(ROOF[2], 2);
      expect(Math.hypot(...ROOF.map((part, k) => part - (click.position?.[k] ?? 0)))).toBeLessThan(0.8);
      await its().evaluate(() => {
        (globalThis as Global).map.container.focus();
      }, null);
      await its().key(ARROW_RIGHT);
      await its().until(([world, x]) => Math.abs(((globalThis as Global).map.project(world)?.[0] ?? 0) - x) < 1, [
        ROOF,
        zoomed[0] - 90,
      ] as const);
      await its().key("q");
      await its().until(() => (globalThis as Global).map.direction === "90-45", null);
      expect(await complaints()).toEqual([]);
    });

    test("the examples show four directions, and then and now", async () => {
      const keep = async (example: string): Promise<Screenshot> => {
        const shot = await its().shot();
        writeFileSync(`${OUT}/${name.toLowerCase().replaceAll(" ", "-")}-${example}.png`, shot.png);
        return shot;
      };
      const colours = ({ rgb }: Screenshot): number =>
        new Set(Array.from({ length: rgb.length / 3 }, (_, k) => rgb.subarray(3 * k, 3 * k + 3).join())).size;
      await its().open(`${server.origin}/examples/directions.html`);
      await its().until(() => maps.every((each) => each.loaded()), null);
      expect(
        await its().evaluate(
          () => [...document.querySelectorAll(".map3d-facing")].map((caption) => caption.textContent.replace(/.* /, "")),
          null,
        ),
      ).toEqual(["north", "east", "south", "west"]);
      expect(await its().evaluate(() => maps.map((each) => each.direction), null)).toEqual(["0-45", "270-45", "180-45", "90-45"]);
      expect(colours(await keep("directions"))).toBeGreaterThan(24);
      await its().open(`${server.origin}/examples/times.html`);
      await its().until(() => map.loaded() && map.layers.length === 2, null);
      expect(colours(await keep("times"))).toBeGreaterThan(24);
      await its().evaluate(() => {
        document.getElementById("switch")?.click();
      }, null);
      await its().until(() => map.loaded() && map.layers.length === 1 && right.loaded(), null);
      expect(await its().evaluate(() => [before, after].map(({ rendering }) => rendering?.json.name), null)).toEqual(["town", "later"]);
      await keep("side-by-side");
    });

    test("a marker is at its position, and its popup opens; buttons are inside the map", async () => {
      await started(its(), "town", { zoom: 2, controls: true, attribution: true });
      await its().settled((world) => {
        const { map, map3d } = globalThis as Global;
        new map3d.marker("Town hall", world).bindPopup("Open till five").addTo(map);
      }, ROOF);
      const [x, y] = await at(its(), ROOF);
      const stands = await its().evaluate(() => {
        const { left, top, width, height } = (document.querySelector(".map3d-marker") as HTMLElement).getBoundingClientRect();
        return [left + width / 2, top + height / 2];
      }, null);
      expect(Math.hypot((stands[0] ?? 0) - x, (stands[1] ?? 0) - y)).toBeLessThan(1);
      await its().click([x, y]);
      await its().until(() => document.querySelector(".map3d-popup-body")?.textContent === "Open till five", null);
      writeFileSync(`${OUT}/${name.toLowerCase().replaceAll(" ", "-")}-marker.png`, (await its().shot()).png);
      const outside = await its().evaluate(
        ([width, height]) =>
          [...document.querySelectorAll(".map3d-group button, .map3d-popup, .map3d-scale, .map3d-attribution")]
            .filter((found) => {
              const box = found.getBoundingClientRect();
              return box.left < 0 || box.top < 0 || box.right > width || box.bottom > height;
            })
            .map((found) => found.outerHTML.slice(0, 80)),
        [WIDTH, HEIGHT] as const,
      );
      expect(outside).toEqual([]);
      expect(await complaints()).toEqual([]);
    });
  });
}

/**
 * Maximum difference from Chromium's pictures (of 255), and the fraction of pixels that differ by more than 2. Measured: WebGL 1; a canvas 0 where a tile pixel is a device
 * pixel, else up to 19 at edges on 1.3 % of the pixels, since browsers scale pictures with their own weights; composited light 4 on 4.2 %,
 * both together 18 on 23 %.
 */
const TOLERANCE = {
  webgl: { most: 2, off: 0 },
  whole: { most: 1, off: 0 },
  scaled: { most: 32, off: 0.03 },
  composed: { most: 8, off: 0.08 },
  both: { most: 32, off: 0.4 },
} as const;
const SCALED = ["two layers", "turned", "between"];

function toleranceOf(scene: string, composed: boolean): keyof typeof TOLERANCE {
  if (SCALED.includes(scene)) return composed ? "both" : "scaled";
  return composed ? "composed" : "whole";
}

/** Key code of WebDriver. */
const ARROW_RIGHT = "\uE014";

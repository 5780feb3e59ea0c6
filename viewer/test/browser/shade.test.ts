import type { Page } from "playwright-core";
import type * as Print from "../../src/print";
import { expect, test } from "vitest";
import { dot, type Vec3 } from "../../src/core/vec";
import { computeAxes, localFromUvd, uvdFromLocal } from "../../src/geo/axes";
import { makeFrame, type Frame } from "../../src/geo/frame";
import { towardsLight } from "../../src/geo/light";
import { withBakedLight } from "../fixture/baked";
import { renderTown } from "../fixture/rendering";
import { ORIGIN, trace, type Hit } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { drawn, picture, settled, type Global } from "./page";

const town = renderTown();
const bed = new TestBed({ town, baked: withBakedLight(town) });
const [WIDTH, HEIGHT] = [600, 480];
/** Light from the left, so that shadows fall beside their casters; sunlight only, and skylight only. */
const SUN = { azimuth_deg: 280, elevation_deg: 38, ambient: 0.1, diffuse: 0.9, occlusion: false };
const SKY = { ambient: 1, diffuse: 0, shadows: false };
const OPTIONS = { center: [ORIGIN[0] - 5, ORIGIN[1], ORIGIN[2]], zoom: 3, direction: "0-45" };
const VIEWPORT = { viewport: { width: WIDTH, height: HEIGHT } };

const numbers = town.json.views.find(({ id }) => id === "0-45") as (typeof town.json.views)[0];
const frame = makeFrame(numbers, town.json.size_m, town.json.tile_px, town.json.zmax);

const addShade = (options: object): unknown => {
  const g = globalThis as Global & { shade: { remove(): void } };
  const made = new (g.map3d as unknown as { shade: new (options: object) => { addTo(map: unknown): never; remove(): void } }).shade(
    options,
  );
  return (g.shade = made.addTo(g.map));
};

async function start(options: object, rendering = "town", context: object = VIEWPORT): ReturnType<TestBed["start"]> {
  const opened = await bed.start(rendering, { ...OPTIONS, ...options }, {}, context);
  await opened.page.addScriptTag({ url: "/map3d-shade.js" });
  return opened;
}

/** U and V of a CSS pixel's centre. */
async function gridOf(page: Page): Promise<(x: number, y: number) => [number, number]> {
  const [corner, px] = await page.evaluate(
    (origin) => [(globalThis as Global).map.project(origin), (globalThis as Global).map.metresPerPixel] as const,
    ORIGIN,
  );
  const [x0, y0] = corner as [number, number];
  return (x, y) => [(x + 0.5 - x0) * px, (y0 - y - 0.5) * px];
}

/** The visible point and the points around it, local. */
const pointOf = ({ d }: Hit, [u, v]: readonly [number, number]): Vec3 => localFromUvd(frame.axes, [u, v, frame.d0 + d]);

/** Whether the sun is visible from a point, past all boxes. */
function seesSun(point: Vec3): boolean {
  const axes = computeAxes((540 - SUN.azimuth_deg) % 360, SUN.elevation_deg);
  const sunny: Frame = { ...frame, axes, d0: -2000 };
  const [u, v, d] = uvdFromLocal(axes, point);
  const first = trace(sunny, u, v);
  return first === null || first.d + sunny.d0 > d - 0.05;
}

test("estimated shadows match rays to the sun for all visible points", async () => {
  expect(dot(computeAxes((540 - SUN.azimuth_deg) % 360, SUN.elevation_deg).forward, towardsLight(SUN))).toBeCloseTo(-1, 9);
  const { page, problems } = await start({ light: SUN });
  const bright = await picture(page);
  await settled(page, addShade, {});
  await page.screenshot({ path: `${OUT}/shade-sun.png` });
  const [dim, uvOf] = [await picture(page), await gridOf(page)];
  const counts = { lit: 0, falsely: 0, shadow: 0, missed: 0 };
  for (let y = 6; y < HEIGHT - 6; y += 2) {
    for (let x = 6; x < WIDTH - 6; x += 2) {
      const seen = [
        [0, 0],
        [-3, 0],
        [3, 0],
        [0, -3],
        [0, 3],
      ].map(([dx = 0, dy = 0]) => {
        const uv = uvOf(x + dx, y + dy);
        const hit = trace(frame, ...uv);
        return hit && { name: `${String(hit.id)} ${String(hit.normal)}`, normal: hit.normal, open: seesSun(pointOf(hit, uv)) };
      });
      const [here] = seen;
      // At an edge, or the edge of a shadow, a pixel may be either.
      if (!here || dot(here.normal, towardsLight(SUN)) < 0.1 || seen.some((other) => other?.name !== here.name || other.open !== here.open))
        continue;
      const dimmed = (dim[4 * (WIDTH * y + x)] ?? 0) < 0.75 * (bright[4 * (WIDTH * y + x)] ?? 0);
      counts[here.open ? (dimmed ? "falsely" : "lit") : dimmed ? "shadow" : "missed"]++;
    }
  }
  console.log("shadows from depth:", JSON.stringify(counts));
  expect(counts.shadow).toBeGreaterThan(500);
  expect(counts.shadow / (counts.shadow + counts.missed)).toBeGreaterThan(0.85);
  expect(counts.lit / (counts.lit + counts.falsely)).toBeGreaterThan(0.97);
  expect(problems).toEqual([]);
});

test("occlusion darkens the ground at the foot of a wall, fades with distance, and leaves roofs and open ground unchanged", async () => {
  const { page } = await start({ light: SKY });
  const bright = await picture(page);
  await settled(page, addShade, {});
  await page.screenshot({ path: `${OUT}/shade-sky.png` });
  const dim = await picture(page);
  const shareAt = async (local: Vec3): Promise<number> => {
    const [x, y] = (await page.evaluate(
      (world) => (globalThis as Global).map.project(world as [number, number, number]),
      local.map((value, k) => value + (ORIGIN[k] ?? 0)),
    )) as [number, number];
    const at = 4 * (WIDTH * Math.round(y) + Math.round(x));
    return (dim[at] ?? 0) / (bright[at] ?? 1);
  };
  // The town hall's front wall is at y = −22.
  const [foot, near, open, roof] = await Promise.all(
    [
      [-45, -23.5, 0],
      [-45, -32, 0],
      [-45, -60, 0],
      [-45, -4, 34],
    ].map((point) => shareAt(point as unknown as Vec3)),
  );
  expect(foot).toBeLessThan(0.88);
  expect(near).toBeGreaterThan((foot ?? 1) + 0.03);
  expect(open).toBeGreaterThan(0.98);
  expect(roof).toBeGreaterThan(0.98);
});

test("after a movement the picture equals that of a map opened there and rests; removal leaves nothing behind", async () => {
  const { page } = await start({ light: SUN });
  const bare = await picture(page);
  await settled(page, addShade, {});
  const before = await picture(page);
  await page.mouse.move(300, 240);
  await page.mouse.down();
  await page.mouse.move(330, 260, { steps: 4 });
  await page.mouse.move(300, 240, { steps: 4 });
  await page.waitForTimeout(200);
  await page.mouse.up();
  await drawn(page);
  expect(Buffer.compare(await picture(page), before)).toBe(0);
  const frames = await page.evaluate(
    () =>
      new Promise<number>((done) => {
        let drawn = 0;
        (globalThis as Global).map.frameEvents.on("draw", () => {
          drawn++;
        });
        setTimeout(() => {
          done(drawn);
        }, 1000);
      }),
  );
  expect(frames).toBe(0);
  await settled(page, () => (globalThis as Global & { shade: { remove(): void } }).shade.remove(), null);
  expect(Buffer.compare(await picture(page), bare)).toBe(0);
});

test("an exported picture of several pieces has the shadows of the screen, at its resolution and at twice of it", async () => {
  const [width, height] = [1100, 260];
  const { page, problems } = await start({ light: { ...SUN, occlusion: true }, zoom: 2.6 }, "town", { viewport: { width, height } });
  await page.addScriptTag({ url: "/map3d-print.js" });
  const bare = await picture(page);
  await settled(page, addShade, {});
  const screen = await picture(page);
  /** The exported picture, averaged to the pixels of the screen. */
  const exported = (scale: number): Promise<number[]> =>
    page.evaluate(async (scale) => {
      const g = globalThis as unknown as Global & { map3d: typeof Print };
      const bitmap = await createImageBitmap(
        await g.map3d.exportPicture(g.map, {
          scale,
          scaleBar: false,
          northArrow: false,
          attribution: "",
          background: "transparent",
          markers: false,
        }),
        { premultiplyAlpha: "none" },
      );
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d") as OffscreenCanvasRenderingContext2D;
      context.drawImage(bitmap, 0, 0);
      const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
      const [columns, rows] = [bitmap.width / scale, bitmap.height / scale];
      return Array.from({ length: columns * rows * 4 }, (_, k) => {
        const [x, y] = [((k >> 2) % columns) * scale, Math.floor((k >> 2) / columns) * scale];
        let sum = 0;
        for (let j = 0; j < scale * scale; j++)
          sum += data[4 * ((y + Math.floor(j / scale)) * bitmap.width + x + (j % scale)) + (k & 3)] ?? 0;
        return sum / scale ** 2;
      });
    }, scale);
  const difference = (a: ArrayLike<number>, b: ArrayLike<number>): { mean: number; most: number } => {
    let [sum, count, most] = [0, 0, 0];
    for (let k = 0; k < screen.length; k += 4) {
      if (screen[k + 3] !== 255) continue;
      const off = Math.abs((a[k] ?? 0) - (b[k] ?? 0));
      [sum, count, most] = [sum + off, count + 1, Math.max(most, off)];
    }
    return { mean: sum / count, most };
  };
  const shaded = difference(screen, bare);
  expect(shaded.mean).toBeGreaterThan(5);
  expect(difference(await exported(1), screen).most).toBeLessThanOrEqual(1);
  const double = difference(await exported(2), screen);
  console.log(
    "shadows on the screen, and its difference from a picture of twice the resolution:",
    shaded.mean.toFixed(2),
    double.mean.toFixed(2),
  );
  expect(double.mean).toBeLessThan(0.25 * shaded.mean);
  // Without shadows from depth, there are none in the picture.
  await settled(page, () => (globalThis as Global & { shade: { remove(): void } }).shade.remove(), null);
  expect(difference(await exported(1), bare).most).toBeLessThanOrEqual(1);
  expect(problems).toEqual([]);
});

test.each([
  ["rendered light suits", "baked", { light: { azimuth_deg: 200, elevation_deg: 50 } }],
  ["the canvas drawer draws", "town", { drawer: "canvas" }],
  ["nothing is lit", "town", { light: { lit: false } }],
] as const)("where %s nothing is found, and no depth fetched", async (_, rendering, options) => {
  const { page, problems } = await start(options, rendering);
  const before = await picture(page);
  bed.server.requests.length = 0;
  await settled(page, addShade, {});
  expect(bed.server.requests.filter((url) => url.includes("/depth/"))).toEqual([]);
  expect(Buffer.compare(await picture(page), before)).toBe(0);
  expect(problems).toEqual([]);
});

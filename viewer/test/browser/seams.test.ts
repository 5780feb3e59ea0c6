import { describe, expect, test } from "vitest";
import type { Page } from "playwright-core";
import { computeLevel } from "../../src/tiles/cover";
import { makeFrame } from "../../src/geo/frame";
import { renderPainted, type Paint } from "../fixture/rendering";
import { compareTo, stitch, type Errors } from "../fixture/stitched";
import { rows } from "./rows";
import { TestBed } from "./testBed";
import { cornerOf } from "./level";
import { decoded, picture, settled, type Global } from "./page";

const [TILE, ZMAX] = [64, 3];
const ZOOMS = Array.from({ length: 20 }, (_, k) => 1.53 + 0.1737 * k);
const VIEWPORT = { width: 240, height: 180 };
/** Centres of the view, metres from the origin: the picture's own, and one near its top left corner. */
const MIDDLES = [
  [1.23, 4.56, 0],
  [-131.7, 133.3, 0],
] as const;

/** Differences between neighbours reveal a missing or extra pixel; a hole contains a tile; hole and picture have soft edges. */
const speckled: Paint = (z, x, y) => {
  const side = TILE * 2 ** z;
  const noise = (k: number): number =>
    (Math.imul(Math.imul(x + 1, 0x9e3779b1) ^ Math.imul(y + 7 * k + 1, 0x85ebca6b), 0xc2b2ae35) >>> 24) / 255;
  const hole = Math.hypot(x + 0.5 - 0.4375 * side, y + 0.5 - 0.3125 * side) - 0.1 * side;
  const rim = Math.min(x, y, side - 1 - x, side - 1 - y) - 1;
  const wave = (at: number): number => 60 * Math.sin((at / side) * 19);
  return [
    128 + wave(x) + 48 * (noise(0) - 0.5),
    128 + wave(y) + 48 * (noise(1) - 0.5),
    128 + wave(x + y) + 48 * (noise(2) - 0.5),
    24 * Math.min(Math.max(rim, 0), Math.max(hole, 0), 255 / 24),
  ];
};

const fixture = renderPainted("speckled", TILE, ZMAX, 150, speckled);
const levels = Array.from({ length: ZMAX + 1 }, (_, z) => stitch(fixture, z));
const frame = makeFrame(fixture.json.views[0] as (typeof fixture.json.views)[0], fixture.json.size_m, TILE, ZMAX);
const bed = new TestBed({ speckled: fixture }, { way: "exact" });

/** Ways to show the picture: CSS-composed elements can be seen only, not read. */
const WAYS = {
  webgl: { drawer: "webgl" },
  canvas: { drawer: "canvas" },
  css: { drawer: "canvas", preserveDrawingBuffer: false, background: "transparent" },
} as const;
type Way = keyof typeof WAYS;

/** RGBA with straight alpha. */
async function seen(page: Page, way: Way): Promise<Buffer> {
  if (way !== "css") return picture(page);
  const { channels, data } = await decoded(await page.screenshot({ omitBackground: true }));
  return channels === 4
    ? Buffer.from(data)
    : Buffer.from(Array.from({ length: (4 * data.length) / 3 }, (_, k) => (k % 4 === 3 ? 255 : (data[3 * (k >> 2) + (k % 4)] ?? 0))));
}

/** Measures how far the map is from the stitched level at a zoom and a centre. */
async function errorsAt(page: Page, way: Way, dpr: number, zoom: number, middle: readonly number[]): Promise<Errors> {
  await settled(
    page,
    ([to, [x, y, z]]) => {
      const { map, layer } = globalThis as Global;
      const origin = layer.rendering?.json.origin ?? [0, 0, 0];
      map.setView([origin[0] + x, origin[1] + y, origin[2] + z], to);
    },
    [zoom, middle as [number, number, number]] as const,
  );
  expect(await page.evaluate(() => (globalThis as Global).map.zoom)).toBe(zoom);
  const [x, y] = await cornerOf(page);
  const level = computeLevel(frame, frame.size / (TILE * 2 ** zoom) / dpr, dpr, Math.min(0, Math.log2(2 / dpr)));
  return compareTo(
    levels[level] as (typeof levels)[0],
    { left: x * dpr, top: y * dpr, px: dpr * 2 ** (zoom - level) },
    await seen(page, way),
    VIEWPORT.width * dpr,
  );
}

const start = (way: Way, dpr: number): ReturnType<TestBed["start"]> =>
  bed.start(
    "speckled",
    { ...WAYS[way], light: { lit: false }, maxPixelRatio: dpr, controls: false, attribution: false },
    {},
    { viewport: VIEWPORT, deviceScaleFactor: dpr },
  );

/** Tolerance of a premultiplied byte: rounding and the shader's snapping to pixels; the canvas interpolates bytes, with low-precision weights. */
const TOLERANCE = { webgl: 1.5, canvas: 4, css: 4 } as const satisfies Record<Way, number>;

test.each((["webgl", "canvas", "css"] as const).flatMap((way) => rows([1, 3], [1.5]).map((dpr) => [way, dpr] as const)))(
  "%s at pixel ratio %d: at twenty zooms the map equals the stitched level, including tile edges",
  async (way, dpr) => {
    const { page, problems } = await start(way, dpr);
    let [edges, elsewhere] = [0, 0];
    for (const [k, zoom] of ZOOMS.entries()) {
      const found = await errorsAt(page, way, dpr, zoom, MIDDLES[k % 2] ?? [0, 0, 0]);
      expect(Math.max(found.edges, found.elsewhere), `at zoom ${String(zoom)} ${found.at}`).toBeLessThan(TOLERANCE[way]);
      [edges, elsewhere] = [Math.max(edges, found.edges), Math.max(elsewhere, found.elsewhere)];
    }
    console.log(
      `seams, ${way}, pixel ratio ${String(dpr)}: off by ${edges.toFixed(2)} of 255 at tile edges, ${elsewhere.toFixed(2)} elsewhere`,
    );
    expect(Math.min(edges, elsewhere)).toBeGreaterThan(0.3);
    expect(problems).toEqual([]);
  },
);

/** Faults that the test above must detect: what they do to the browser, and how far off the map is then at least. */
const faults = {
  "quads a device pixel short": [
    "webgl",
    80,
    () => {
      const set = Object.getOwnPropertyDescriptor(WebGL2RenderingContext.prototype, "uniform4f")?.value as (
        this: WebGL2RenderingContext,
        ...given: unknown[]
      ) => void;
      WebGL2RenderingContext.prototype.uniform4f = function (at, left, ...rest) {
        set.call(this, at, left + 2 / this.canvas.width, ...rest);
      };
    },
  ],
  "pixels of the tile beside not mixed in": [
    "webgl",
    6,
    () => {
      const set = Object.getOwnPropertyDescriptor(WebGL2RenderingContext.prototype, "uniform4i")?.value as (
        this: WebGL2RenderingContext,
        ...given: unknown[]
      ) => void;
      WebGL2RenderingContext.prototype.uniform4i = function (at) {
        set.call(this, at, 0, 0, 63, 63);
      };
    },
  ],
  "a tile's first column left out": [
    "canvas",
    80,
    () => {
      const put = Object.getOwnPropertyDescriptor(CanvasRenderingContext2D.prototype, "putImageData")?.value as (
        this: CanvasRenderingContext2D,
        ...given: unknown[]
      ) => void;
      CanvasRenderingContext2D.prototype.putImageData = function (
        this: CanvasRenderingContext2D,
        image: ImageData,
        x: number,
        y: number,
      ): void {
        put.call(this, image, x, y, 1, 0, image.width - 1, image.height);
        put.call(this, new ImageData(1, image.height), x, y);
      };
    },
  ],
  "a tile's second column in place of its first": [
    "canvas",
    12,
    () => {
      const put = Object.getOwnPropertyDescriptor(CanvasRenderingContext2D.prototype, "putImageData")?.value as (
        this: CanvasRenderingContext2D,
        ...given: unknown[]
      ) => void;
      CanvasRenderingContext2D.prototype.putImageData = function (
        this: CanvasRenderingContext2D,
        image: ImageData,
        x: number,
        y: number,
      ): void {
        put.call(this, image, x, y);
        put.call(this, image, x - 1, y, 1, 0, 1, image.height);
      };
    },
  ],
} as const satisfies Record<string, readonly [Way, number, () => void]>;

describe("a fault is detected, and at tile edges only", () => {
  const each = Object.entries(faults).flatMap(([name, [drawer, least, breakIt]]) =>
    (drawer === "canvas" ? (["canvas", "css"] as const) : [drawer]).flatMap((way) =>
      [1, 3].map((dpr) => [name, way, dpr, least, breakIt] as const),
    ),
  );
  test.each(each)("%s, %s, pixel ratio %d", async (_, way, dpr, least, breakIt) => {
    const { page } = await start(way, dpr);
    await page.evaluate(breakIt);
    await errorsAt(page, way, dpr, 1.6, MIDDLES[0]); // other tiles, so that those of the next position are composed from scratch
    const found = await errorsAt(page, way, dpr, 3.2671, MIDDLES[0]);
    expect(found.edges, found.at).toBeGreaterThan(least);
    expect(found.elsewhere).toBeLessThan(TOLERANCE[way]);
  });
});

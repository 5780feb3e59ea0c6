import { describe, expect, test } from "vitest";
import { computeCorner, computeBias, overlaps, joinDepthRanges, type Clip, type DepthMapping } from "../../src/draw/depthMapping";
import { forEachHidden, makeMask } from "../../src/draw/canvas/mask";
import { makeFrame, pixelM, uvOfPixel } from "../../src/geo/frame";
import type { ManifestJson, Rendering } from "../../src/geo/manifest";
import { findIncompatibility } from "../../src/map/compatibility";
import { findCombinedLayers, groupByDepth } from "../../src/map/depthGroups";
import type { ImageLayer } from "../../src/map/imageLayer";
import { NO_DEPTH } from "../../src/tiles/tileData";

const VIEW = { id: "0-45", look_at_deg: 0, pitch_deg: 45, u0_m: -50, v0_m: 40, d0_m: -1000 };
const own: DepthMapping = { frame: makeFrame(VIEW, 100, 16, 2), shift: [0, 0, 0], unit_m: 1 / 1024, bias_m: 0, range: [-900, -800] };
const other: DepthMapping = {
  frame: makeFrame({ ...VIEW, u0_m: -70, v0_m: 61, d0_m: -1200 }, 170, 16, 3),
  shift: [7.25, -3.5, 11],
  unit_m: 1 / 512,
  bias_m: 0.5,
  range: [-950, -700],
};

describe("a mask", () => {
  test("reads the pixel at the centre of each pixel, at any level and origin", () => {
    const [tile, above] = [
      { z: 1, x: 0, y: 1 },
      { z: 3, x: 2, y: 3 },
    ];
    const mask = makeMask(own, tile, other, above, { depth: "d", color: null });
    if (!mask) throw new Error("the tiles overlap");
    const [u0, v0, px] = computeCorner(other, above);
    for (const [i, j] of [
      [0, 0],
      [3, 5],
      [9, 1],
      [15, 15],
    ] as const) {
      const [u, v] = uvOfPixel(own.frame, tile, i, j);
      expect(Math.floor(mask.x + i * mask.step)).toBe(Math.floor((u - u0) / px));
      expect(Math.floor(mask.y + j * mask.step)).toBe(Math.floor((v0 - v) / px));
    }
    // D is −900 m in both: the bias puts this layer behind the other.
    const [here, there] = [(-900 + 1000) * 1024, (-900 - 11 + 1200) * 512];
    expect((here * mask.unit + mask.first - there) / 512).toBeCloseTo(0.5, 9);
  });

  test("does not exist for tiles that do not overlap", () => {
    expect(makeMask(own, { z: 2, x: 0, y: 0 }, other, { z: 3, x: 7, y: 7 }, { depth: "d", color: null })).toBeNull();
  });

  test("hides only what is behind covered pixels; edges without a depth take the nearest one around them", () => {
    const depth = Uint32Array.of(10, 30, NO_DEPTH, 50);
    const color = Uint8ClampedArray.from([0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0, 100]);
    const mask = { depth: "d", color: "c", x: 0.5, y: 0.5, step: 1, unit: 1, first: 0 };
    const hidden: number[] = [];
    forEachHidden(4, 1, depth, [{ mask, width: 4, height: 1, depth: Uint32Array.of(20, 20, 20, 20), color }], (at) => hidden.push(at));
    expect(hidden).toEqual([1, 2]);
  });
});

test("the later of two equally near layers is visible, by a bias of one pixel each", () => {
  expect(computeBias(own.frame, 1, 0)).toBe(0);
  expect(computeBias(own.frame, 1, 2)).toBeCloseTo(2 * pixelM(own.frame, 1), 12);
  const [near, far] = joinDepthRanges([own, other]) ?? [0, 0];
  expect(near).toBeLessThan(-950.5);
  expect(far).toBeGreaterThan(-700);
  expect(joinDepthRanges([])).toBeNull();
});

test("clips overlap if they have a point in common", () => {
  expect(overlaps(null, [0, 0, 0.1, 1])).toBe(true);
  expect(overlaps([0, 0, 0.5, 1], [0.5, 0, 1, 1])).toBe(false);
  expect(overlaps([0, 0, 0.51, 1], [0.5, 0.9, 1, 1])).toBe(true);
});

test("combined layers form one group at the position of the first", () => {
  const layer = (name: string, combines: boolean, clip: Clip | null = null): ImageLayer =>
    ({ name, isCombinable: combines, clip }) as unknown as ImageLayer;
  const [a, b, c, d] = [layer("a", false), layer("b", true), layer("c", false), layer("d", true)];
  expect(groupByDepth([a, b, c, d])).toEqual([[a], [b, d], [c]]);
  expect(findCombinedLayers([a, b, c])).toEqual([]);
  expect(groupByDepth([a, b, c])).toEqual([[a], [b], [c]]);
  const [left, right] = [layer("left", true, [0, 0, 0.4, 1]), layer("right", true, [0.4, 0, 1, 1])];
  expect(findCombinedLayers([left, right])).toEqual([]);
  expect(findCombinedLayers([left, b, right])).toEqual([left, b, right]);
});

describe("renderings on one map", () => {
  const rendering = (crs: Partial<ManifestJson["crs"]>, angles: readonly (readonly [number, number])[] = [[0, 45]]): Rendering => ({
    json: { crs: { epsg: 25832, wkt: null, name: "UTM 32", vertical: null, ...crs } } as ManifestJson,
    views: new Map(
      angles.map(([a, p]) => [
        `${String(a)}:${String(p)}`,
        { frame: makeFrame({ ...VIEW, look_at_deg: a, pitch_deg: p }, 10, 16, 1) } as never,
      ]),
    ),
    layers: new Map(),
  });

  test("are compatible if they share CRS, heights and a view, whatever the views' ids", () => {
    expect(findIncompatibility(rendering({}), rendering({ name: "ETRS89 / UTM zone 32N" }))).toBeNull();
    expect(
      findIncompatibility(
        rendering({}),
        rendering({}, [
          [90, 45],
          [0, 45],
        ]),
      ),
    ).toBeNull();
    expect(findIncompatibility(rendering({ epsg: null }), rendering({ epsg: null }))).toBeNull();
  });

  test("are refused with a reason", () => {
    expect(findIncompatibility(rendering({}), rendering({ epsg: 2056, name: "LV95" }))).toMatch(
      /CRS is "EPSG:2056 LV95".*"EPSG:25832 UTM 32"/,
    );
    expect(findIncompatibility(rendering({ epsg: null, name: "a" }), rendering({ epsg: null, name: "b" }))).toMatch(/CRS is "b"/);
    expect(findIncompatibility(rendering({ epsg: null, wkt: "A" }), rendering({ epsg: null, wkt: "B" }))).toMatch(/CRS/);
    expect(findIncompatibility(rendering({ vertical: "DHHN2016" }), rendering({ vertical: "NAP" }))).toMatch(/heights are NAP.*DHHN2016/);
    expect(findIncompatibility(rendering({}), rendering({}, [[0, 30]]))).toMatch(/none of the map's views: it has 0:30, the map has 0:45/);
  });
});

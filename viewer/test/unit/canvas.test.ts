import { describe, expect, test } from "vitest";
import type { LayerPass } from "../../src/draw/drawer";
import {
  listNeighbourKinds,
  listKinds,
  makeShadingOptions,
  type ShadingOptions,
  type TileLight,
} from "../../src/draw/canvas/shadingOptions";
import { computeTileLight, type LightLayers } from "../../src/draw/canvas/tileLight";
import type { DrawStyles } from "../../src/draw/drawStyle";
import { computeIdColor, shadeTile, type TileNeighbours, type StylesById } from "../../src/draw/canvas/shadeTile";
import { findArea, makeGrid } from "../../src/draw/canvas/tileMosaic";
import { placeQuads } from "../../src/draw/quads";
import { makeFrame } from "../../src/geo/frame";
import { DEFAULT_LIGHT, towardsLight } from "../../src/geo/light";

const LIGHT: TileLight = {
  sun: towardsLight(DEFAULT_LIGHT),
  sky: [0.42, 0.42, 0.42],
  beam: [0.76, 0.76, 0.76],
  occlusion: false,
  shadow: null,
};
const OPTIONS: ShadingOptions = {
  mode: "id",
  masked: false,
  light: null,
  highlight: null,
  styles: null,
  rim: [0, 0],
  depthRange: null,
  combined: false,
  masks: [],
};
const NO_STYLES: StylesById = { colors: undefined, styles: undefined };
const NO_NEIGHBOURS: TileNeighbours = { lightLayers: [], id: [], masks: [] };
const bytes = (...normal: number[][]): LightLayers => ({ normal: Uint8Array.from(normal.flat()) });
const UP = [128, 128, 255];
const SOUTH = [128, 0, 128];
const NOTHING = [0, 0, 0];

/** Fraction of sunlight on a stored normal. */
const strength = (stored: number[]): number => {
  const n = stored.map((byte) => (byte / 255) * 2 - 1);
  const cosine = n.reduce((sum, part, k) => sum + part * LIGHT.sun[k as 0], 0) / Math.hypot(...n);
  return Math.max(0, cosine);
};

describe("light", () => {
  test("is half a pixel's own and an eighth of each neighbour's, also across tile borders", () => {
    const [sky, light] = computeTileLight(LIGHT, 1, 1, bytes(UP), [bytes(SOUTH), bytes(SOUTH), bytes(UP), undefined]);
    expect(sky).toBe(1);
    expect(light).toBeCloseTo(0.75 * strength(UP) + 0.25 * strength(SOUTH), 6);
  });

  test("within a tile is the same as across a border", () => {
    const whole = computeTileLight(LIGHT, 2, 1, bytes(UP, SOUTH), []);
    expect(computeTileLight(LIGHT, 1, 1, bytes(UP), [undefined, bytes(SOUTH)])[1]).toBe(whole[1]);
    expect(computeTileLight(LIGHT, 1, 1, bytes(SOUTH), [bytes(UP)])[1]).toBe(whole[3]);
    const column = computeTileLight(LIGHT, 1, 2, bytes(UP, SOUTH), []);
    expect(computeTileLight(LIGHT, 1, 1, bytes(UP), [, , , bytes(SOUTH)])[1]).toBe(column[1]);
    expect(computeTileLight(LIGHT, 1, 1, bytes(SOUTH), [, , bytes(UP)])[1]).toBe(column[3]);
  });

  test("at an outer edge is the pixel's own; without a normal it is medium", () => {
    const light = computeTileLight(LIGHT, 2, 1, bytes(UP, NOTHING), []);
    expect(light[1]).toBeCloseTo(strength(UP), 6);
    expect([light[2], light[3]]).toEqual([1, 0.5]);
  });

  test("is dimmed by each pixel's own occlusion and shadow", () => {
    const shades = (ao: number, suns: number): LightLayers => ({ ...bytes(UP), ao: Uint8Array.of(ao), shadow: Uint16Array.of(suns) });
    const lamp: TileLight = { ...LIGHT, occlusion: true, shadow: { kind: "sun16", first: 3, second: 4, share: 0.25 } };
    const [sky, sun] = computeTileLight(lamp, 1, 1, shades(255, 0b01000), [
      shades(51, 0b10000),
      shades(51, 0),
      shades(255, 0b11000),
      undefined,
    ]);
    expect(sky).toBeCloseTo(0.5 + (0.2 + 0.2 + 1 + 1) / 8, 6);
    expect(sun).toBeCloseTo(strength(UP) * (0.75 / 2 + (0.25 + 0 + 1 + 0.75) / 8), 6);
  });
});

describe("a shaded tile", () => {
  const ids = Uint32Array.of(7, 7, 7, 7, 9, 0, 7, 7, 7);
  const tile = { width: 3, height: 3, id: ids };

  test("in mode id has one colour per id, and nothing without an id", () => {
    const out = shadeTile(OPTIONS, tile, NO_NEIGHBOURS, NO_STYLES);
    expect([...out.subarray(0, 4)]).toEqual([...out.subarray(4, 8)]);
    expect([...out.subarray(0, 4)]).toEqual([...computeIdColor(7).map((part) => Math.round(255 * part)), 255]);
    expect(out[4 * 5 + 3]).toBe(0);
  });

  test("in mode color keeps stored colours; a masked one only where there are ids", () => {
    const color = Uint8ClampedArray.from({ length: 36 }, (_, k) => (k % 4 === 3 ? 255 : 7 * k));
    expect([...shadeTile({ ...OPTIONS, mode: "color" }, { ...tile, color }, NO_NEIGHBOURS, NO_STYLES)]).toEqual([...color]);
    const masked = shadeTile({ ...OPTIONS, mode: "color", masked: true }, { ...tile, color }, NO_NEIGHBOURS, NO_STYLES);
    expect([masked[4 * 4 + 3], masked[4 * 5 + 3]]).toEqual([255, 0]);
  });

  test("has a highlight's rim where a neighbouring id differs, also across the tile's edge", () => {
    const options = { ...OPTIONS, highlight: "h", rim: [1, -1] as const };
    const rims = (neighbours: TileNeighbours): number[] => {
      const out = shadeTile(options, { width: 3, height: 3, id: new Uint32Array(9).fill(7) }, neighbours, {
        ...NO_STYLES,
        colors: new Map([[7, [1, 0, 0]]]),
      });
      return [0, 1, 2, 3, 4, 5, 6, 7, 8].filter((at) => out[4 * at] === 255 && out[4 * at + 1] === 0);
    };
    expect(rims(NO_NEIGHBOURS)).toEqual([]);
    expect(rims({ masks: [], lightLayers: [], id: [undefined, new Uint32Array(9).fill(8)] })).toEqual([2, 5, 8]);
    expect(rims({ masks: [], lightLayers: [], id: [undefined, undefined, new Uint32Array(9)] })).toEqual([0, 1, 2]);
  });

  test("applies objects' styles: tinted, dimmed, hidden, and the default for others", () => {
    const color = Uint8ClampedArray.from({ length: 36 }, (_, k) => (k % 4 === 3 ? 255 : 40 + 60 * (k % 4)));
    const found = (styles: DrawStyles): number[][] => {
      const out = shadeTile({ ...OPTIONS, mode: "color", styles: "f" }, { ...tile, color }, NO_NEIGHBOURS, { ...NO_STYLES, styles });
      return [0, 4, 5].map((at) => [...out.subarray(4 * at, 4 * at + 4)]);
    };
    const own = [40, 100, 160, 255];
    const painted = [40 + 0.85 * 215, 100 - 0.85 * 100, 160 - 0.85 * 160].map((byte) => Math.round(byte));
    const pale = Math.round(0.35 * (0.2126 * 40 + 0.7152 * 100 + 0.0722 * 160) + 0.65 * 0.86 * 255);
    const none = found({ byId: new Map([[9, "hidden"]]), others: "plain" });
    expect(none[0]).toEqual(own);
    expect(none[1]?.[3]).toBe(0);
    expect(found({ byId: new Map([[9, [1, 0, 0]]]), others: "dimmed" })).toEqual([[pale, pale, pale, 255], [...painted, 255], own]);
    expect(found({ byId: new Map([[7, "plain"]]), others: "hidden" }).map(([, , , alpha]) => alpha)).toEqual([255, 0, 255]);
  });

  test("in mode depth runs from the first to the last colour", () => {
    const out = shadeTile(
      { ...OPTIONS, mode: "depth", depthRange: [100, 300] },
      { width: 2, height: 2, depth: Uint32Array.of(0, 200, 5000, 0xffffffff) },
      NO_NEIGHBOURS,
      NO_STYLES,
    );
    expect([...out]).toEqual([252, 232, 178, 255, 92, 158, 158, 255, 41, 46, 92, 255, 0, 0, 0, 0]);
  });
});

describe("shading options", () => {
  const pass = {
    mode: "lit",
    masked: true,
    depths: null,
    clip: null,
    depthRange: [0, 9],
    bakedLight: { shadow: null, occlusion: false },
  } as unknown as LayerPass;
  const frame = { width: 1, height: 1, dpr: 1, light: DEFAULT_LIGHT, passes: [] };

  test("list the layers that a tile needs, and those that matter beyond its edges", () => {
    const options = makeShadingOptions(frame, pass, 1, { highlight: "h", styles: null });
    expect(listKinds(options)).toEqual(["color", "normal", "id"]);
    expect(listNeighbourKinds(options)).toEqual(["normal", "id"]);
  });

  test("do not depend on a light that is off", () => {
    const dark = { ...frame, light: { ...DEFAULT_LIGHT, lit: false } };
    expect(makeShadingOptions(dark, pass, 1, { highlight: null, styles: null })).toEqual(
      makeShadingOptions({ ...dark, light: { ...dark.light, azimuth_deg: 3 } }, pass, 2, { highlight: null, styles: null }),
    );
    expect(listKinds(makeShadingOptions(dark, { ...pass, masked: false }, 1, { highlight: null, styles: null }))).toEqual(["color"]);
  });
});

test("areas are recovered from their rectangles at any zoom", () => {
  const frame = makeFrame({ id: "0-45", look_at_deg: 0, pitch_deg: 45, u0_m: -512, v0_m: 512, d0_m: 0 }, 1024, 256, 5);
  for (const px_m of [1, 0.7, 0.31, 0.123]) {
    const fallbacks = [
      { area: { z: 4, x: 9, y: 3 }, from: { z: 4, x: 9, y: 3 } },
      { area: { z: 4, x: 10, y: 3 }, from: { z: 1, x: 1, y: 0 } },
      { area: { z: 6, x: 44, y: 15 }, from: { z: 6, x: 44, y: 15 } },
    ];
    const quads = placeQuads(frame, { left: -77.3, top: 41.9, px_m }, fallbacks, 4);
    for (const quad of quads) {
      const grid = makeGrid({ quads: [quad], level: 4 } as unknown as LayerPass, 256);
      expect(quads.map(({ rect }) => grid && findArea(grid, rect))).toEqual(fallbacks.map(({ area }) => area));
      expect(grid?.px).toBeCloseTo(1024 / 16 / 256 / px_m, 6);
    }
  }
});

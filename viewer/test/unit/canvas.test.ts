import { describe, expect, test } from "vitest";
import type { Pass } from "../../src/draw/drawer";
import { listNeighbourKinds, listKinds, makeShadingOptions, type ShadingOptions, type TileLight } from "../../src/draw/canvas/shadingOptions";
import { computeTileLight, type LightLayers } from "../../src/draw/canvas/tileLight";
import type { DrawStyles } from "../../src/draw/drawStyle";
import { computeIdColor, shadeTile, type TileNeighbours, type StylesById } from "../../src/draw/canvas/shadeTile";
import { findArea, makeGrid } from "../../src/draw/canvas/tileMosaic";
import { placeQuads } from "../../src/draw/quads";
import { makeFrame } from "../../src/geo/frame";
import { DEFAULT_LIGHT, towardsLight } from "../../src/geo/light";

const LAMP: TileLight = { sun: towardsLight(DEFAULT_LIGHT), sky: [0.42, 0.42, 0.42], beam: [0.76, 0.76, 0.76], occlusion: false, shadow: null };
const LOOK: ShadingOptions = { mode: "id", masked: false, light: null, highlight: null, styles: null, rim: [0, 0], depthRange: null, combined: false, masks: [] };
const UNSAID: StylesById = { colors: undefined, styles: undefined };
const ALONE: TileNeighbours = { lightLayers: [], id: [], masks: [] };
const bytes = (...normal: number[][]): LightLayers => ({ normal: Uint8Array.from(normal.flat()) });
const UP = [128, 128, 255];
const SOUTH = [128, 0, 128];
const NOTHING = [0, 0, 0];

/** Share of the sun's light on a stored normal. */
const strength = (stored: number[]): number => {
  const n = stored.map((byte) => (byte / 255) * 2 - 1);
  const cosine = n.reduce((sum, part, k) => sum + part * (LAMP.sun[k as 0]), 0) / Math.hypot(...n);
  return Math.max(0, cosine);
};

describe("light", () => {
  test("is half a pixel's own and an eighth of each neighbour's, across tile borders, too", () => {
    const [sky, light] = computeTileLight(LAMP, 1, 1, bytes(UP), [bytes(SOUTH), bytes(SOUTH), bytes(UP), undefined]);
    expect(sky).toBe(1);
    expect(light).toBeCloseTo(0.75 * strength(UP) + 0.25 * strength(SOUTH), 6);
  });

  test("of a tile's own pixels is the same as across a border", () => {
    const whole = computeTileLight(LAMP, 2, 1, bytes(UP, SOUTH), []);
    expect(computeTileLight(LAMP, 1, 1, bytes(UP), [undefined, bytes(SOUTH)])[1]).toBe(whole[1]);
    expect(computeTileLight(LAMP, 1, 1, bytes(SOUTH), [bytes(UP)])[1]).toBe(whole[3]);
    const column = computeTileLight(LAMP, 1, 2, bytes(UP, SOUTH), []);
    expect(computeTileLight(LAMP, 1, 1, bytes(UP), [, , , bytes(SOUTH)])[1]).toBe(column[1]);
    expect(computeTileLight(LAMP, 1, 1, bytes(SOUTH), [, , bytes(UP)])[1]).toBe(column[3]);
  });

  test("beside nothing, a pixel's own counts; where there is no normal it is middling", () => {
    const light = computeTileLight(LAMP, 2, 1, bytes(UP, NOTHING), []);
    expect(light[1]).toBeCloseTo(strength(UP), 6);
    expect([light[2], light[3]]).toEqual([1, 0.5]);
  });

  test("is dimmed by occlusion and shadows, each pixel by its own", () => {
    const shades = (ao: number, suns: number): LightLayers => ({ ...bytes(UP), ao: Uint8Array.of(ao), shadow: Uint16Array.of(suns) });
    const lamp: TileLight = { ...LAMP, occlusion: true, shadow: { kind: "sun16", first: 3, second: 4, share: 0.25 } };
    const [sky, sun] = computeTileLight(lamp, 1, 1, shades(255, 0b01000), [shades(51, 0b10000), shades(51, 0), shades(255, 0b11000), undefined]);
    expect(sky).toBeCloseTo(0.5 + (0.2 + 0.2 + 1 + 1) / 8, 6);
    expect(sun).toBeCloseTo(strength(UP) * (0.75 / 2 + (0.25 + 0 + 1 + 0.75) / 8), 6);
  });
});

describe("pictures", () => {
  const ids = Uint32Array.of(7, 7, 7, 7, 9, 0, 7, 7, 7);
  const tile = { width: 3, height: 3, id: ids };

  test("of ids have the same colour for the same id, and nothing where there is none", () => {
    const out = shadeTile(LOOK, tile, ALONE, UNSAID);
    expect([...out.subarray(0, 4)]).toEqual([...out.subarray(4, 8)]);
    expect([...out.subarray(0, 4)]).toEqual([...computeIdColor(7).map((part) => Math.round(255 * part)), 255]);
    expect(out[4 * 5 + 3]).toBe(0);
  });

  test("show stored colours as they are; masked, where the ids say so", () => {
    const color = Uint8ClampedArray.from({ length: 36 }, (_, k) => (k % 4 === 3 ? 255 : 7 * k));
    expect([...shadeTile({ ...LOOK, mode: "color" }, { ...tile, color }, ALONE, UNSAID)]).toEqual([...color]);
    const masked = shadeTile({ ...LOOK, mode: "color", masked: true }, { ...tile, color }, ALONE, UNSAID);
    expect([masked[4 * 4 + 3], masked[4 * 5 + 3]]).toEqual([255, 0]);
  });

  test("have a highlight's rim where the id beside is another, beyond the tile's edge, too", () => {
    const look = { ...LOOK, highlight: "h", rim: [1, -1] as const };
    const rims = (around: TileNeighbours): number[] => {
      const out = shadeTile(look, { width: 3, height: 3, id: new Uint32Array(9).fill(7) }, around, { ...UNSAID, colors: new Map([[7, [1, 0, 0]]]) });
      return [0, 1, 2, 3, 4, 5, 6, 7, 8].filter((at) => out[4 * at] === 255 && out[4 * at + 1] === 0);
    };
    expect(rims(ALONE)).toEqual([]);
    expect(rims({ masks: [], lightLayers: [], id: [undefined, new Uint32Array(9).fill(8)] })).toEqual([2, 5, 8]);
    expect(rims({ masks: [], lightLayers: [], id: [undefined, undefined, new Uint32Array(9)] })).toEqual([0, 1, 2]);
  });

  test("take an object's finish: painted, pale, not at all; others as is said", () => {
    const color = Uint8ClampedArray.from({ length: 36 }, (_, k) => (k % 4 === 3 ? 255 : 40 + 60 * (k % 4)));
    const found = (styles: DrawStyles): number[][] => {
      const out = shadeTile({ ...LOOK, mode: "color", styles: "f" }, { ...tile, color }, ALONE, { ...UNSAID, styles });
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

  test("of depths run from the first to the last colour", () => {
    const out = shadeTile({ ...LOOK, mode: "depth", depthRange: [100, 300] }, { width: 2, height: 2, depth: Uint32Array.of(0, 200, 5000, 0xffffffff) }, ALONE, UNSAID);
    expect([...out]).toEqual([252, 232, 178, 255, 92, 158, 158, 255, 41, 46, 92, 255, 0, 0, 0, 0]);
  });
});

describe("looks", () => {
  const pass = { mode: "lit", masked: true, depths: null, clip: null, depthRange: [0, 9], bakedLight: { shadow: null, occlusion: false } } as unknown as Pass;
  const frame = { width: 1, height: 1, dpr: 1, light: DEFAULT_LIGHT, passes: [] };

  test("name what they need and what counts beyond the edge", () => {
    const look = makeShadingOptions(frame, pass, 1, { highlight: "h", styles: null });
    expect(listKinds(look)).toEqual(["color", "normal", "id"]);
    expect(listNeighbourKinds(look)).toEqual(["normal", "id"]);
  });

  test("without light do not depend on it", () => {
    const dark = { ...frame, light: { ...DEFAULT_LIGHT, lit: false } };
    expect(makeShadingOptions(dark, pass, 1, { highlight: null, styles: null })).toEqual(makeShadingOptions({ ...dark, light: { ...dark.light, azimuth_deg: 3 } }, pass, 2, { highlight: null, styles: null }));
    expect(listKinds(makeShadingOptions(dark, { ...pass, masked: false }, 1, { highlight: null, styles: null }))).toEqual(["color"]);
  });
});

test("areas are found again from their rectangles, at any zoom", () => {
  const frame = makeFrame({ id: "0-45", look_at_deg: 0, pitch_deg: 45, u0_m: -512, v0_m: 512, d0_m: 0 }, 1024, 256, 5);
  for (const px_m of [1, 0.7, 0.31, 0.123]) {
    const stands = [{ area: { z: 4, x: 9, y: 3 }, from: { z: 4, x: 9, y: 3 } }, { area: { z: 4, x: 10, y: 3 }, from: { z: 1, x: 1, y: 0 } }, { area: { z: 6, x: 44, y: 15 }, from: { z: 6, x: 44, y: 15 } }];
    const quads = placeQuads(frame, { left: -77.3, top: 41.9, px_m }, stands, 4);
    for (const quad of quads) {
      const grid = makeGrid({ quads: [quad], level: 4 } as unknown as Pass, 256);
      expect(quads.map(({ rect }) => grid && findArea(grid, rect))).toEqual(stands.map(({ area }) => area));
      expect(grid?.px).toBeCloseTo(1024 / 16 / 256 / px_m, 6);
    }
  }
});

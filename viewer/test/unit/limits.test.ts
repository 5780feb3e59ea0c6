import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { describe, expect, test } from "vitest";
import { ManifestError } from "../../src/core/errors";
import { DEEPEST_LEVEL, morton } from "../../src/geo/frame";
import { readManifest, type Rendering } from "../../src/geo/manifest";

interface Limits {
  tile_px: number[];
  deepest_level: number;
  suns: number;
}
const limits = JSON.parse(readFileSync(resolve(import.meta.dirname, "../../../spec/limits.json"), "utf8")) as Limits;

const read = (change: object): Rendering =>
  readManifest(
    {
      map3d: "rendering",
      version: 1,
      name: "town",
      title: "",
      attribution: "",
      content_version: 1,
      complete: true,
      crs: { epsg: null, wkt: null, name: "local metres", vertical: null },
      origin: [0, 0, 0],
      box: [
        [0, 0, 0],
        [1, 1, 1],
      ],
      tile_px: 256,
      zmax: 4,
      size_m: 1024,
      layers: [{ name: "color", kind: "color", format: "png", media_type: "image/png" }],
      views: [{ id: "0-45", look_at_deg: 0, pitch_deg: 45, u0_m: 0, v0_m: 0, d0_m: 0, occupancy: "AA==", version: 1, versions: {} }],
      ...change,
    },
    "rendering.json",
  );

describe("limits", () => {
  test("the deepest level is that of the specification", () => {
    expect(DEEPEST_LEVEL).toBe(limits.deepest_level);
    expect(read({ zmax: limits.deepest_level }).json.zmax).toBe(limits.deepest_level);
    expect(() => read({ zmax: limits.deepest_level + 1 })).toThrow(ManifestError);
  });

  test("Morton numbers are exact at the deepest level", () => {
    const last = 2 ** limits.deepest_level - 1;
    expect(morton(last, last)).toBe(4 ** limits.deepest_level - 1);
    expect(Number.isSafeInteger(morton(last, last))).toBe(true);
  });

  test.each(limits.tile_px)("tiles of %i px are read", (tilePx) => {
    expect(read({ tile_px: tilePx }).json.tile_px).toBe(tilePx);
  });

  test("a layer may have as many suns as the specification allows", () => {
    const suns = Array.from({ length: limits.suns }, () => ({ time: null, azimuth_deg: 0, elevation_deg: 90, direction: [0, 0, 1] }));
    const layer = { name: "day", kind: "sun16", format: "png", media_type: "image/png", suns };
    expect(read({ layers: [layer] }).json.layers[0]?.suns).toHaveLength(limits.suns);
  });
});

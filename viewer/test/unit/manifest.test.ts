import { describe, expect, test } from "vitest";
import { ManifestError } from "../../src/core/errors";
import { readManifest, type LayerInfo, type ManifestJson, type Rendering } from "../../src/geo/manifest";

const layer = (name: string, kind = name): LayerInfo => ({ name, kind, format: "png", media_type: "image/png" });

/** Two blocks have versions of their own: base block 1/0/1, in `ao` base block 1/1/0. */
function document(change: object = {}): ManifestJson {
  const versions = { version: 3, versions: { "1/0/1": 2 } };
  const passes = [
    { layers: ["ao", "far"], version: 5, versions: { "1/1/0": 4 } },
    { layers: ["evening"], version: 6 },
  ];
  const frame = { id: "0-45", look_at_deg: 0, pitch_deg: 45, u0_m: -512, v0_m: 512, d0_m: 0 };
  return {
    map3d: "rendering",
    version: 1,
    name: "town",
    title: "",
    attribution: "",
    content_version: 6,
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
    layers: [layer("color"), layer("id"), layer("depth"), layer("ao"), layer("far", "depth"), layer("evening", "sun")],
    views: [{ ...frame, occupancy: "AA==", ...versions, passes, ...change }],
  };
}

const read = (value: unknown): Rendering => readManifest(value, "rendering.json");

describe("versions", () => {
  test.each([
    ["color", { z: 4, x: 0, y: 15 }, 2],
    ["id", { z: 4, x: 15, y: 0 }, 3],
    ["color", { z: 0, x: 0, y: 0 }, 3],
    ["ao", { z: 4, x: 0, y: 15 }, 5],
    ["ao", { z: 4, x: 15, y: 0 }, 4],
    ["far", { z: 1, x: 1, y: 0 }, 4],
    ["ao", { z: 0, x: 0, y: 0 }, 5],
    ["evening", { z: 4, x: 15, y: 0 }, 6],
  ])("a tile of layer %s at %o has the version of its pass's block, %i", (name, tile, version) => {
    const rendering = read(document());
    const info = rendering.json.layers.find((one) => one.name === name) as LayerInfo;
    expect(rendering.views.get("0-45")?.versionOf(tile, info)).toBe(version);
  });

  test("without passes all layers have the view's versions", () => {
    const view = read(document({ passes: undefined })).views.get("0-45");
    expect(view?.versionOf({ z: 4, x: 0, y: 15 }, layer("ao"))).toBe(2);
  });

  test.each([[null], ["ao"], [[null]], [[{ layers: ["ao"] }]], [[{ layers: "ao", version: 1 }]], [[{ version: 1 }]]])(
    "passes %o are refused",
    (passes) => {
      expect(() => read(document({ passes }))).toThrow(ManifestError);
    },
  );
});

describe("layers", () => {
  test("the first layer of a kind is used", () => {
    expect(read(document()).layers.get("depth")?.name).toBe("depth");
  });

  test("unknown kinds are ignored", () => {
    const json = document();
    const rendering = read({ ...json, layers: [layer("x", "moonlight"), ...json.layers] });
    expect([...rendering.layers.keys()].sort()).toEqual(["ao", "color", "depth", "id", "moonlight", "sun"]);
    expect(rendering.layers.get("color")?.name).toBe("color");
  });

  test("a layer of data tiles stands for normals, ids and depths", () => {
    const data = { ...layer("data", "data"), format: "m3d", media_type: "application/vnd.map3d.data", unit_m: 2 ** -10 };
    const { layers } = read({ ...document(), layers: [layer("color"), data] });
    expect([...layers.keys()].sort()).toEqual(["color", "depth", "id", "normal"]);
    expect(layers.get("depth")).toEqual({ ...data, kind: "depth" });
  });
});

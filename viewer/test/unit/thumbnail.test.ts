import { describe, expect, test } from "vitest";
import { Evented } from "../../src/core/events";
import { showThumbnail } from "../../src/element/thumbnail";
import { cssPixelM, screenFromUv, type Camera } from "../../src/geo/camera";
import { uvOfPixel } from "../../src/geo/frame";
import { readManifest, type Rendering } from "../../src/geo/manifest";
import type { ImageLayer, Map3D } from "../../src/map3d";

const WEBP = "UklGRiQAAABXRUJQVlA4==";
const GOOD = { window: [76, 95.5, 102, 70.5], webp: WEBP };

/** A rendering of two views whose squares begin at different places. */
function read(thumbnails: readonly unknown[]): Rendering {
  const views = [
    [0, -512, 700],
    [90, -300, 400],
  ].map(([look_at_deg = 0, u0_m = 0, v0_m = 0], k) => ({
    id: `${String(look_at_deg)}-45`,
    look_at_deg,
    pitch_deg: 45,
    u0_m,
    v0_m,
    d0_m: 0,
    occupancy: "AA==",
    version: 1,
    thumbnail: thumbnails[k],
  }));
  const layers = [{ name: "color", kind: "color", format: "png", media_type: "image/png" }];
  return readManifest(
    JSON.parse(
      JSON.stringify({
        map3d: "rendering",
        version: 1,
        origin: [0, 0, 0],
        box: [
          [0, 0, 0],
          [1, 1, 1],
        ],
        tile_px: 256,
        zmax: 4,
        size_m: 1024,
        layers,
        views,
      }),
    ),
    "rendering.json",
  );
}

/** A map as far as a thumbnail needs one, with a layer of a rendering. */
class Stand extends Evented<{ load: object }> {
  readonly container = { style: { background: "" } };
  readonly frameEvents = new Evented<{ draw: object }>();
  readonly light = { elevation_deg: 48 };
  readonly layer: { rendering: Rendering | undefined; mode: string; opacity: number };
  camera: Camera;

  constructor(rendering: Rendering, shown = "0-45") {
    super();
    this.layer = { rendering, mode: "lit", opacity: 1 };
    this.camera = { frame: rendering.views.get(shown)?.frame as Camera["frame"], u: -37, v: 61.5, zoom: 1.3, width: 900, height: 500 };
    showThumbnail(this as unknown as Map3D, this.layer as unknown as ImageLayer);
  }

  get metresPerPixel(): number {
    return cssPixelM(this.camera);
  }

  getViewState(): { camera: Camera } {
    return { camera: this.camera };
  }

  /** Draws a frame and returns the background. */
  draw(): string {
    this.frameEvents.fire("draw", {});
    return this.container.style.background;
  }
}

/** Reads left, top, width and height from a background. */
function rectOf(background: string): number[] {
  const [, ...numbers] =
    /^url\(data:image\/webp;base64,[\w+/=]+\) (\S+)px (\S+)px\/(\S+)px (\S+)px no-repeat,var\(--map3d-background\)$/.exec(background) ?? [];
  return numbers.map(Number);
}

/** Corners of the window on the screen: those of the pixels of the tile of level 0. */
function corners({ camera }: Stand, [left = 0, top = 0, width = 0, height = 0]: readonly number[]): number[] {
  const at = (i: number, j: number): readonly [number, number] =>
    screenFromUv(camera, uvOfPixel(camera.frame, { z: 0, x: 0, y: 0 }, i - 0.5, j - 0.5));
  return [...at(left, top), ...at(left + width, top + height)];
}

describe("a thumbnail", () => {
  test.each([
    ["0-45", 1.3],
    ["0-45", 0],
    ["90-45", 3.7],
    ["90-45", -1.5],
  ] as const)("of view %s lies over the pixels of level 0 at zoom %d, and moves with the camera", (id, zoom) => {
    const other = { ...GOOD, window: [3, 5, 64, 32.25] };
    const stand = new Stand(read([GOOD, other]), id);
    for (const camera of [{ zoom }, { zoom, u: 1200.25, v: -7 }, { zoom: zoom + 0.5, width: 390, height: 844 }]) {
      stand.camera = { ...stand.camera, ...camera };
      const [x = NaN, y = NaN, width = NaN, height = NaN] = rectOf(stand.draw());
      corners(stand, (id === "0-45" ? GOOD : other).window).forEach((expected, k) => {
        expect([x, y, x + width, y + height][k]).toBeCloseTo(expected, 6);
      });
    }
  });

  test("is that of the view that is shown", () => {
    const stand = new Stand(read([GOOD, { ...GOOD, webp: "AAAA" }]));
    expect(stand.draw()).toContain(WEBP);
    stand.camera = { ...stand.camera, frame: stand.layer.rendering?.views.get("90-45")?.frame as Camera["frame"] };
    expect(stand.draw()).toContain("base64,AAAA)");
  });

  test("goes once everything is drawn, for good", () => {
    const stand = new Stand(read([GOOD]));
    expect(stand.draw()).not.toBe("");
    stand.fire("load", {});
    expect(stand.container.style.background).toBe("");
    expect(stand.draw()).toBe("");
  });

  test.each<[string, (stand: Stand) => void]>([
    [
      "before the manifest has loaded",
      ({ layer }) => {
        layer.rendering = undefined;
      },
    ],
    [
      "when the camera belongs to another rendering",
      ({ layer }) => {
        layer.rendering = read([GOOD]);
      },
    ],
    [
      "at night",
      ({ light }) => {
        light.elevation_deg = -20;
      },
    ],
    [
      "when the sun is low",
      ({ light }) => {
        light.elevation_deg = 9;
      },
    ],
    [
      "in another mode",
      ({ layer }) => {
        layer.mode = "depth";
      },
    ],
    [
      "when the layer is transparent",
      ({ layer }) => {
        layer.opacity = 0;
      },
    ],
  ])("is not shown %s", (_, change) => {
    const stand = new Stand(read([GOOD]));
    expect(stand.draw()).not.toBe("");
    change(stand);
    expect(stand.draw()).toBe("");
  });

  test.each<[unknown]>([
    [undefined],
    [null],
    [7],
    ["x"],
    [[]],
    [{}],
    [{ webp: WEBP }],
    [{ window: GOOD.window }],
    ...[
      null,
      5,
      "1,2,3,4",
      {},
      { every: 1 },
      [],
      [1, 2, 3],
      [1, 2, 3, 4, 5],
      [1, 2, 3, "4"],
      [1, 2, 3, null],
      [1, 2, [3], 4],
      [-1, 2, 3, 4],
      [1, 2, 3, 1e300],
      [1, 2, 3, { toString: 1, valueOf: 1 }],
    ].map((window): [unknown] => [{ ...GOOD, window }]),
    ...[
      null,
      5,
      "",
      ["AAAA"],
      { toString: 1 },
      "AA AA",
      "AAAA)",
      "AAAA);color:red",
      "AA\nAA",
      "AA\\41",
      'AA"',
      "https://example.org/x.webp",
      "AAAA,url(//example.org)",
    ].map((webp): [unknown] => [{ ...GOOD, webp }]),
  ])("is not shown, without an error, when it is %j", (thumbnail) => {
    expect(new Stand(read([thumbnail])).draw()).toBe("");
  });
});

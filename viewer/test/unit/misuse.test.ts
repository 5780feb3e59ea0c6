import { afterEach, describe, expect, test, vi } from "vitest";
import { UsageError } from "../../src/core/errors";
import type { Vec3 } from "../../src/core/vec";
import { DEFAULT_LIGHT, clampLight } from "../../src/geo/light";
import { readManifest } from "../../src/geo/manifest";
import { CameraController } from "../../src/map/cameraController";
import { ImageLayer } from "../../src/map/imageLayer";
import { Map3D } from "../../src/map/map";
import { fillOptions } from "../../src/core/options";
import { MAP_OPTIONS, type FilledOptions } from "../../src/map/options";
import { Viewport } from "../../src/map/viewport";
import { Marker } from "../../src/overlay/marker";

const RENDERING = readManifest(
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
      [100, 100, 10],
    ],
    tile_px: 256,
    zmax: 4,
    size_m: 1024,
    layers: [{ name: "color", kind: "color", format: "png", media_type: "image/png" }],
    views: [{ id: "0-45", look_at_deg: 0, pitch_deg: 45, u0_m: -512, v0_m: 512, d0_m: -1000, occupancy: "AA==", version: 1, versions: {} }],
  },
  "rendering.json",
);

/** A map's camera without a map. */
class Controller extends CameraController {
  readonly options = fillOptions(MAP_OPTIONS, { dataSaver: false }) as FilledOptions;
  protected readonly size = { width: 800, height: 600, dpr: 1 };
  protected requestFrame(): void {
    /* nothing is drawn */
  }
  report(error: Error): void {
    throw error;
  }
  protected findCenterSurface(): Vec3 | null {
    return null;
  }
  protected isCovered(): boolean {
    return true;
  }
  findPosition(): Promise<Vec3> {
    return Promise.resolve([50, 50, 5]);
  }
  start(): this {
    this.initializeView(RENDERING);
    return this;
  }
  get numbers(): (number | undefined)[] {
    return [this.camera?.u, this.camera?.v, this.camera?.zoom];
  }
}

/** Calls with arguments that TypeScript would refuse, as JavaScript does. */
type Loose = Record<string, (...given: unknown[]) => unknown>;

afterEach(() => {
  vi.unstubAllGlobals();
});

describe("a camera", () => {
  const rows: [name: string, given: unknown[], message: RegExp][] = [
    ["setView", [691000, 5336000], /setView: expected \[x, y, z\], metres in the scene's CRS, got 691000/],
    ["setView", [[691000, 5336000]], /setView: expected \[x, y, z\].*got \[691000,5336000\]/],
    ["setView", [["1", "2", "3"]], /setView: .*got \["1","2","3"\]/],
    ["setView", [[1, NaN, 3]], /setView: .*got \[1,"NaN",3\]/],
    ["setView", [undefined], /setView: .*got undefined/],
    ["setView", [null], /setView: .*got null/],
    ["setView", [[1, 2, 3], "4"], /zoom: expected a number, got "4"/],
    ["setView", [[1, 2, 3], NaN], /zoom: expected a number, got "NaN"/],
    ["flyTo", [{ x: 1 }], /expected \[x, y, z\].*got \{"x":1\}/],
    ["setView", [{ lonLat: [11] }], /setView: expected lonLat: \[longitude, latitude\] in degrees, got \[11\]/],
    ["panTo", [{ xy: [1, 2], height: "roof" }], /setView: expected height: metres, or "ground", got \["roof"\]/],
    ["project", [{ lonLat: [11, 48] }], /cannot locate rendering "town" on earth; use \[x, y, z\]/],
    ["setMaxBounds", [[[0, 0, 0]]], /maxBounds: expected \[x, y, z\].*got undefined/],
    ["setMaxBounds", [7], /maxBounds: expected \[x, y, z\]/],
    ["setZoom", ["3"], /zoom: expected a number, got \["3"\]/],
    ["setZoom", [], /zoom: expected a number/],
    ["zoomBy", [NaN], /zoomBy: expected levels/],
    ["panBy", [1], /panBy: expected two numbers of CSS pixels/],
    [
      "fitBounds",
      [
        [
          [0, 0, 0],
          [1, 1],
        ],
      ],
      /fitBounds: expected \[x, y, z\]/,
    ],
    ["project", [[1, 2]], /project: expected \[x, y, z\]/],
    ["unproject", [[1, "2"]], /unproject: expected \[x, y\] in CSS pixels/],
    ["fromLonLat", [[11]], /fromLonLat: expected \[longitude, latitude\]/],
    ["setDirection", [90], /unknown view "90"; the rendering has 0-45/],
    ["on", ["clik", () => undefined], /unknown event "clik"; use ready, load/],
    ["once", ["moved", () => undefined], /unknown event "moved"/],
    ["on", ["click"], /on\("click"\): expected a function/],
  ];

  test.each(rows)("%s(%j) is refused, and nothing becomes NaN", (name, given, message) => {
    vi.stubGlobal("matchMedia", () => ({ matches: false }));
    const camera = new Controller().start();
    const before = camera.numbers;
    expect(() => (camera as unknown as Loose)[name]?.(...given)).toThrow(
      expect.objectContaining({ name: "UsageError", message: expect.stringMatching(message) as string }),
    );
    expect(camera.numbers).toEqual(before);
    expect(before.every(Number.isFinite)).toBe(true);
  });

  test("before the manifest has loaded, wrong calls are refused at once, too", () => {
    expect(() => new Controller().setView([1, 2] as unknown as Vec3)).toThrow(UsageError);
  });
});

describe("markers and layers", () => {
  const make = (given: unknown[]) => (): unknown => new (Marker as unknown as new (...args: unknown[]) => unknown)(...given);

  test.each([
    [["Town hall"], /position: expected \[x, y, z\].*got undefined/],
    [["Town hall", [1, 2]], /position: expected \[x, y, z\].*got \[1,2\]/],
    [["Town hall", [1, 2, "3"]], /got \[1,2,"3"\]/],
    [["Town hall", [1, 2, 3], { draggable: true }], /draggable needs the entry drag: load map3d-drag.js after map3d.js/],
    [["Town hall", [1, 2, 3], { colour: "red" }], /unknown option "colour"; use color, showLabel/],
  ])("a marker of %j is refused", (given, message) => {
    expect(make(given)).toThrow(expect.objectContaining({ name: "UsageError", message: expect.stringMatching(message) as string }));
  });

  test("a marker keeps its position when it is given a wrong one, and knows its events", () => {
    const pin = new Marker("Town hall", [1, 2, 3]);
    expect(() => pin.setPosition([4, 5] as unknown as Vec3)).toThrow(UsageError);
    expect(pin.position).toEqual([1, 2, 3]);
    expect(() => (pin as unknown as Loose)["on"]?.("mouseover", () => undefined)).toThrow(
      'unknown event "mouseover"; use click, select, deselect, dragstart, drag, dragend',
    );
    expect(pin.on("click", () => undefined)).toBe(pin);
  });

  test("a layer needs URLs, known options and known events", () => {
    vi.stubGlobal("document", { baseURI: "http://host/" });
    const layer =
      (...given: unknown[]) =>
      (): unknown =>
        new (ImageLayer as unknown as new (...args: unknown[]) => unknown)(...given);
    for (const urls of [undefined, null, "", [], [undefined], 3]) expect(layer(urls)).toThrow(/needs at least one base URL/);
    expect(layer("town", { opactiy: 0.5 })).toThrow('unknown option "opactiy"; use mode, opacity, highlightColor, attribution, combine');
    expect(layer("town", { opacity: "0.5" })).toThrow('opacity: expected a number, got "0.5"');
    expect(() => (new ImageLayer("town") as unknown as Loose)["on"]?.("load", () => undefined)).toThrow(
      'unknown event "load"; use ready, error, click, mouseover, mouseout, mousemove',
    );
    expect(() => new ImageLayer("town").bindTooltip("a")).toThrow(
      'bindTooltip needs the entry tooltip: load map3d-tooltip.js after map3d.js, or import "map3d/tooltip"',
    );
    expect(() => new ImageLayer("town").setOpacity(NaN)).toThrow(UsageError);
  });
});

test.each([
  [{ azimuth: 3 }, /unknown option "azimuth"; use lit, azimuth_deg/],
  [{ azimuth_deg: NaN }, /azimuth_deg: expected a number/],
  [{ elevation_deg: "30" }, /elevation_deg: expected a number, got \["30"\]/],
  [{ sun_rgb: [1, 1] }, /sun_rgb: expected three numbers, got \[1,1\]/],
])("a light of %j is refused", (light, message) => {
  expect(() => clampLight({ ...DEFAULT_LIGHT, ...light } as typeof DEFAULT_LIGHT)).toThrow(message);
});

describe("a map", () => {
  /** As much of an element as a map's place in the page needs. */
  class FakeElement {
    readonly style = { setProperty: () => undefined, cssText: "" };
    readonly classList = { add: () => undefined, remove: () => undefined };
    readonly id = "town";
    readonly parentElement = null;
    readonly nodeType = 1;
    setAttribute(): void {
      /* has none */
    }
    append(): void {
      /* has no content */
    }
    remove(): void {
      /* is in no page */
    }
  }
  const stubPage = (): void => {
    vi.stubGlobal("HTMLCanvasElement", class extends FakeElement {});
    vi.stubGlobal(
      "ResizeObserver",
      class {
        observe(): void {
          /* sizes stay */
        }
        disconnect(): void {
          /* as they were */
        }
      },
    );
    vi.stubGlobal("getComputedStyle", () => ({ position: "relative" }));
    vi.stubGlobal("window", { devicePixelRatio: 1 });
    vi.stubGlobal("document", { createElement: () => new FakeElement(), getElementById: () => null });
  };
  const open = (target: unknown): Viewport => new Viewport(target as HTMLElement, () => undefined);

  test("needs an element of its own", () => {
    stubPage();
    const place = new FakeElement();
    const first = open(place);
    expect(() => open(place)).toThrow('the element "town" has a map already; call its remove() first, or use another element');
    first.destroy();
    expect(open(place).container).toBe(place);
  });

  test.each([
    ["nowhere", /no element has the id "nowhere"; pass a <canvas>/],
    [null, /not an element; pass a <canvas>/],
    [{}, /not an element; pass/],
  ])("%j is no element", (target, message) => {
    stubPage();
    expect(() => open(target)).toThrow(message);
  });

  test.each([
    [{ zom: 3 }, /unknown option "zom"; use controls, /],
    [{ center: [1, 2] }, /center: expected \[x, y, z\]/],
    [{ zoom: "3" }, /zoom: expected a number, got "3"/],
    [{ concurrency: NaN }, /concurrency: expected a number/],
  ])("options %j are refused", (options, message) => {
    stubPage();
    expect(() => new Map3D("canvas", options as object)).toThrow(message);
  });
});

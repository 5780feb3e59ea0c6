import { expect, test } from "vitest";
import { computeAxes, localFromUvd, uvdFromLocal } from "../../src/geo/axes";
import type { Vec3 } from "../../src/core/vec";
import { corners } from "../../src/core/vec";
import { pixelM, type Tile } from "../../src/geo/frame";
import type { LayerKind, View } from "../../src/map3d";
import { epsgOf, isNorthFirst, isSameSystem } from "../../src/portrayal/axisOrder";
import type { Capabilities, ProjectionParameter } from "../../src/portrayal/capabilities";
import { makeViews, parseViewId, placeCamera } from "../../src/portrayal/grid";
import {
  checkImageOptions,
  chooseAdditionalImages,
  chooseImages,
  describeLayers,
  type RequestedImage,
} from "../../src/portrayal/imageFormats";
import type { PortrayalOptions } from "../../src/portrayal/options";
import { formatNumber, objectUrl, viewUrl, withQuery, type ViewTemplate } from "../../src/portrayal/requestUrls";
import { BOX, CAMERA, COLOR, NORMAL, TEMPLATE } from "../fixture/portrayalRequest";

const WEBP: RequestedImage = { ...COLOR, format: "image/webp", mediaType: "image/webp" };
const AO: RequestedImage = { kind: "ao", identifier: "AO", format: "image/png", mediaType: "image/png" };
const SUN: RequestedImage = { ...AO, kind: "sun", identifier: "SUN" };
const ORIGIN: Vec3 = [691000, 5336000, 500];

// From the EPSG register, by pyproj: axis_info of each system.
test.each([
  [25832, false],
  [32633, false],
  [2056, false],
  [28992, false],
  [3857, false],
  [5514, false],
  [31466, true],
  [31467, true],
  [31468, true],
  [31469, true],
  [3034, true],
  [3035, true],
  [3006, true],
  [2180, true],
  [2326, true],
  [2393, true],
  [2443, true],
  [6677, true],
  [3067, false],
  [5555, false],
  [2100, false],
  [31470, false],
  [31465, false],
  [1, false],
  [999_999, false],
])("EPSG:%i has the northing first: %s", (epsg, expected) => {
  expect(isNorthFirst(epsg)).toBe(expected);
});

test.each([
  ["EPSG:25832", 25832],
  ["epsg:31467", 31467],
  ["urn:ogc:def:crs:EPSG::31468", 31468],
  ["urn:ogc:def:crs:EPSG:9.9.1:3035", 3035],
  ["http://www.opengis.net/def/crs/EPSG/0/25833", 25833],
  ["http://www.opengis.net/gml/srs/epsg.xml#4326", 4326],
  ["EPSG:25832+7837", 25832],
  ["urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::7837", 25832],
  ["CRS:84", null],
  ["urn:map3d:def:crs:local:town", null],
])("the code of %s is %s", (name, code) => {
  expect(epsgOf(name)).toBe(code);
  expect(isSameSystem(name, code === null ? name : `EPSG:${String(code)}`)).toBe(true);
});

test.each([
  ["45-22.5", [45, 22.5]],
  ["0-90", [0, 90]],
  ["359.5-1", [359.5, 1]],
])("view %s", (id, expected) => {
  expect(parseViewId(id)).toEqual(expected);
});

test.each(["", "45", "360-45", "0-0", "0-90.5", "-45-45", "45-1e1", "٤٥-٤٥", "NaN-45"])("view %j is refused", (id) => {
  expect(() => parseViewId(id)).toThrow(/expected a look-at angle from 0 to 360/);
});

test("a tile is occupied exactly if the projection of the box meets it", () => {
  const { views, zmax } = makeViews(BOX, ["30-35", "45-90", "90-10"], 0.5, 64);
  expect(zmax).toBeGreaterThan(2);
  for (const { frame, occupancy } of views) {
    const side = frame.size / 2 ** zmax;
    const inside = new Set<string>();
    const steps = Array.from({ length: 121 }, (_, k) => (k / 120) * 1.05 - 1.05 / 2);
    const center: Vec3 = [0, 0, 20];
    const size: Vec3 = [200, 100, 40];
    for (const [a, b, c] of surface(steps)) {
      const [u, v] = uvdFromLocal(frame.axes, [center[0] + a * size[0], center[1] + b * size[1], center[2] + c * size[2]]);
      inside.add(`${String(Math.floor((u - frame.u0) / side))}/${String(Math.floor((frame.v0 - v) / side))}`);
    }
    for (let y = -1; y <= 2 ** zmax; y++) {
      for (let x = -1; x <= 2 ** zmax; x++) {
        if (inside.has(`${String(x)}/${String(y)}`))
          expect(occupancy.has({ z: zmax, x, y }), `${frame.id} ${String(x)}/${String(y)}`).toBe(true);
      }
    }
    const count = Array.from({ length: 4 ** zmax }, (_, k) =>
      occupancy.has({ z: zmax, x: k % 2 ** zmax, y: Math.floor(k / 2 ** zmax) }),
    ).filter(Boolean).length;
    expect(count).toBeLessThan(1.25 * inside.size + 12);
    for (const tile of [
      { z: -1, x: 0, y: 0 },
      { z: zmax + 1, x: 0, y: 0 },
      { z: 1, x: 2, y: 0 },
      { z: 1, x: 0, y: -1 },
    ] as Tile[])
      expect(occupancy.has(tile)).toBe(false);
    expect(occupancy.has({ z: 0, x: 0, y: 0 })).toBe(true);
  }
});

/** Points of a unit cube's surface. */
function* surface(steps: readonly number[]): Generator<Vec3> {
  const ends = [steps[0] as number, steps.at(-1) as number];
  for (const a of steps)
    for (const b of steps)
      for (const end of ends)
        yield* [
          [a, b, end],
          [a, end, b],
          [end, a, b],
        ] as Vec3[];
}

test("the square of each view holds the box, and its depths begin in front of it", () => {
  const { views, size_m, zmax } = makeViews(BOX, ["0-45", "17-3", "45-90"], 0.25, 256);
  expect(size_m).toBe(256 * 0.25 * 2 ** zmax);
  for (const { frame } of views) {
    for (const corner of corners(BOX)) {
      const [u, v, d] = uvdFromLocal(frame.axes, corner);
      expect(u > frame.u0 && u < frame.u0 + size_m && v < frame.v0 && v > frame.v0 - size_m && d > frame.d0 + 900).toBe(true);
    }
  }
  expect(() => makeViews(BOX, ["0-45"], 1e-9, 256)).toThrow(/the limit is 26/);
});

test("the camera of a tile looks along the view, at its middle", () => {
  const [view] = makeViews(BOX, ["30-40"], 0.5, 256).views as [View];
  const tile = { z: 1, x: 1, y: 0 };
  const { position, target, half_m, far_m } = placeCamera(view.frame, tile, ORIGIN, BOX);
  const local = position.map((value, k) => value - (ORIGIN[k] as number)) as unknown as Vec3;
  const axes = computeAxes(30, 40);
  expect(half_m).toBeCloseTo((pixelM(view.frame, 1) * 256) / 2, 9);
  expect(local).toEqual(
    localFromUvd(axes, [view.frame.u0 + 3 * half_m, view.frame.v0 - half_m, view.frame.d0]).map(
      (value) => expect.closeTo(value, 6) as number,
    ),
  );
  expect(target.map((value, k) => (value - (position[k] as number)) / 1000)).toEqual(
    axes.forward.map((value) => expect.closeTo(value, 9) as number),
  );
  expect(far_m).toBeGreaterThan(Math.max(...corners(BOX).map((corner) => uvdFromLocal(axes, corner)[2])) - view.frame.d0);
});

const named = (...names: string[]): ProjectionParameter[] =>
  names.map((name) => ({ name: name.replace("?", ""), required: !name.endsWith("?") }));

test.each<[string, Partial<ViewTemplate>, object, string]>([
  ["the standard's order", {}, {}, "1,2,3,4,5,-6.5,,,,-12.8,12.8,-12.8,12.8,1,2000"],
  ["northings first", { northFirst: true }, {}, "2,1,3,5,4,-6.5,,,,-12.8,12.8,-12.8,12.8,1,2000"],
  [
    "one number per parameter",
    {
      projection: named(
        "pocx1",
        "pocx2",
        "pocx3",
        "poix1",
        "poix2",
        "poix3",
        "upx1?",
        "upx2?",
        "upx3?",
        "left?",
        "right?",
        "bottom?",
        "top?",
        "nearplane?",
        "farplane?",
      ),
    },
    {},
    "1,2,3,4,5,-6.5,,,,-12.8,12.8,-12.8,12.8,1,2000",
  ],
  [
    "another order, UP required",
    { projection: named("up", "farplane", "roll?", "top", "bottom", "right", "left", "poi", "poc") },
    {},
    "0,0,1,2000,,12.8,-12.8,12.8,-12.8,4,5,-6.5,1,2,3",
  ],
  ["straight down", { northFirst: true }, { straightDown: true }, "2,1,3,5,4,-6.5,0.5,0,0.5,-12.8,12.8,-12.8,12.8,1,2000"],
])("GetView: %s", (_, template, camera, expected) => {
  const url = viewUrl({ ...TEMPLATE, ...template }, { ...CAMERA, ...camera }, [COLOR, NORMAL]);
  expect(url).toBe(
    `https://example.org/3dps?service=3DPS&request=GetView&version=1.0&crs=EPSG%3A25832&layers=town&transparentBackground=true&portrayals=WIDTH=256;HEIGHT=256;PROJECTION=Orthographic,${expected};IMAGELAYERS=COLOR,NORMAL;FORMATS=image%2Fpng%3Bmode%3D32bit,image%2Fpng`,
  );
});

test.each<[string, readonly RequestedImage[], Partial<ViewTemplate>, string, string]>([
  ["none", [COLOR, NORMAL], {}, "", ""],
  ["a quality for each image", [NORMAL, WEBP], { colorQuality: 70 }, "", ";QUALITIES=100,70"],
  ["a quality of 0", [WEBP], { colorQuality: 0 }, "", ";QUALITIES=0"],
  ["a quality without colours", [NORMAL], { colorQuality: 70 }, "", ""],
  ["a sun", [COLOR, SUN], { sun: { azimuth_deg: 359.5, elevation_deg: 0.25 } }, "&sun=359.5,0.25", ""],
  ["a sun without its image", [COLOR, AO], { sun: { azimuth_deg: 1, elevation_deg: 2 } }, "", ""],
])("GetView: %s", (_, images, template, sun, qualities) => {
  const url = viewUrl({ ...TEMPLATE, ...template }, CAMERA, images);
  expect(/&sun=[^&]*/.exec(url)?.[0] ?? "").toBe(sun);
  expect(/;QUALITIES=.*$/.exec(url)?.[0] ?? "").toBe(qualities);
});

test("a required parameter that is not known is refused", () => {
  expect(() => viewUrl({ ...TEMPLATE, projection: named("poc", "poi", "shear") }, CAMERA, [COLOR])).toThrow(
    /requires the parameter "shear"/,
  );
});

test.each([
  [0, "0"],
  [-0, "0"],
  [100, "100"],
  [1e-10, "0"],
  [-1e-10, "0"],
  [0.1 + 0.2, "0.3"],
  [5336000.123456789, "5336000.123456789"],
  [-12.5, "-12.5"],
  [1e21 / 1e5, "10000000000000000"],
])("%d is written as %s", (value, expected) => {
  expect(formatNumber(value)).toBe(expected);
});

test.each([
  ["https://h/x", "https://h/x?a"],
  ["https://h/x?", "https://h/x?a"],
  ["https://h/x?map=1", "https://h/x?map=1&a"],
  ["https://h/x?map=1&", "https://h/x?map=1&a"],
  ["https://h/x#y", "https://h/x?a"],
])("parameters of %s", (base, expected) => {
  expect(withQuery(base, "a")).toBe(expected);
});

test("names are encoded one by one", () => {
  expect(viewUrl({ ...TEMPLATE, layers: ["a,b", "c&d=ü"], styles: ["", "x;y"] }, CAMERA, [NORMAL])).toContain(
    "&layers=a%2Cb,c%26d%3D%C3%BC&styles=,x%3By&portrayals=",
  );
  expect(objectUrl("https://h/?", ["a,b"], 7, "text/xml")).toBe(
    "https://h/?service=3DPS&request=GetFeatureInfoByObjectId&version=1.0&layers=a%2Cb&objectId=7&format=text%2Fxml",
  );
});

const offered = (layers: Record<string, string[]>): Capabilities => ({
  provider: "",
  operations: new Map(),
  layers: [],
  orthographic: null,
  multipart: true,
  imageLayers: new Map(Object.entries(layers).map(([name, formats]) => [name, { identifier: name, formats }])),
});
const chosen = (images: ReadonlyMap<LayerKind, RequestedImage>): object =>
  Object.fromEntries([...images].map(([kind, { format }]) => [kind, format]));

test("formats: exact ones first, and none that would mix data", () => {
  expect(
    chosen(
      chooseImages(
        offered({
          COLOR: ["image/jpeg", "image/png", "image/png;mode=32bit"],
          NORMAL: ["image/jpeg", "image/png"],
          OBJECTID: ["image/png;Mode=32Bit"],
          DEPTH: ["image/png;mode=24bit"],
        }),
      ),
    ),
  ).toEqual({ color: "image/png;mode=32bit", normal: "image/png", id: "image/png;Mode=32Bit" });
  expect(chosen(chooseImages(offered({ COLOR: ["image/jpeg"], NORMAL: ["image/jpeg"] })))).toEqual({ color: "image/jpeg" });
  expect(chosen(chooseImages(offered({ COLOR: ["image/png", "image/webp"] }), "image/webp"))).toEqual({ color: "image/webp" });
  expect(chooseImages(offered({ COLOR: ["image/png"] }), "image/webp").size).toBe(0);
  const jpeg = { kind: "color", identifier: "COLOR", format: "image/jpg", mediaType: "image/jpeg" } as const;
  expect(describeLayers(new Map([["color", jpeg]]))[0]?.format).toBe("opaque");
  expect(
    describeLayers(
      new Map<LayerKind, RequestedImage>([
        ["color", jpeg],
        ["id", { ...NORMAL, kind: "id" }],
      ]),
    )[0]?.format,
  ).toBe("jpeg");
});

const withSunParameter = (layers: Record<string, string[]>, ...parameters: string[]): Capabilities => ({
  ...offered(layers),
  operations: new Map([["GetView", { url: null, formats: [], parameters: new Set(parameters) }]]),
});
const sun = { azimuth_deg: 135, elevation_deg: 45 };

test("additional images are those that the options ask for", () => {
  const full = withSunParameter({ COLOR: ["image/png"], AO: ["image/jpeg", "image/png"], SUN: ["image/png"] }, "portrayals", "sun");
  expect(chooseAdditionalImages(full, {}, "x")).toEqual([]);
  expect(chooseAdditionalImages(full, { occlusion: true }, "x")).toEqual([AO]);
  expect(chooseAdditionalImages(full, { occlusion: true, sun }, "x")).toEqual([AO, SUN]);
  const [ao, shadow] = describeLayers(
    new Map<LayerKind, RequestedImage>([
      ["ao", AO],
      ["sun", SUN],
    ]),
    sun,
  );
  expect(ao).toEqual({ name: "ao", kind: "ao", format: "png", media_type: "image/png" });
  // In the south-east, half-way up.
  expect(shadow?.suns?.map(({ direction }) => direction)).toEqual([
    [0.5, -0.5, Math.SQRT1_2].map((value) => expect.closeTo(value, 12) as number),
  ]);
});

test.each<[string, PortrayalOptions, Record<string, string[]>, string[], RegExp]>([
  [
    "no AO",
    { occlusion: true },
    { COLOR: ["image/png"], SUN: ["image/png"] },
    ["sun"],
    /^occlusion: https:\/\/h does not advertise the image layer AO; it has COLOR, SUN$/,
  ],
  ["AO with losses only", { occlusion: true }, { AO: ["image/jpeg"] }, [], /^occlusion: .* AO as image\/png; it has image\/jpeg$/],
  ["no SUN", { sun }, { COLOR: ["image/png"], AO: ["image/png"] }, ["sun"], /^sun: .* the image layer SUN; it has COLOR, AO$/],
  [
    "a sun that cannot be chosen",
    { sun },
    { SUN: ["image/png"] },
    ["portrayals"],
    /^sun: the GetView of https:\/\/h does not advertise the parameter SUN/,
  ],
])("what a service does not advertise is refused: %s", (_, options, layers, parameters, words) => {
  expect(() => chooseAdditionalImages(withSunParameter(layers, ...parameters), options, "https://h")).toThrow(words);
});

test.each<[PortrayalOptions, RegExp]>([
  [{ colorQuality: 101, colorFormat: "image/webp" }, /colorQuality: expected a whole number from 0 to 100, got 101/],
  [{ colorQuality: 50.5, colorFormat: "image/webp" }, /colorQuality: expected a whole number/],
  [{ colorQuality: 50 }, /colorQuality: needs a lossy colorFormat, image\/jpeg or image\/webp, got none/],
  [{ colorQuality: 50, colorFormat: "image/png" }, /got image\/png/],
  [{ sun: { azimuth_deg: -1, elevation_deg: 45 } }, /sun: expected azimuth_deg from 0 to 360/],
  [{ sun: { azimuth_deg: 0, elevation_deg: 0 } }, /elevation_deg above 0 and up to 90, got 0 and 0/],
  [{ sun: { azimuth_deg: 0, elevation_deg: NaN } }, /got 0 and NaN/],
])("options of images are checked: %j", (options, words) => {
  expect(() => {
    checkImageOptions(options);
  }).toThrow(words);
});

test.each<PortrayalOptions>([
  {},
  { colorQuality: 0, colorFormat: "image/webp" },
  { colorQuality: 100, colorFormat: "Image/JPEG" },
  { colorQuality: 7, colorFormat: "image/jpg" },
  { sun: { azimuth_deg: 360, elevation_deg: 90 }, occlusion: false },
])("valid options of images: %j", (options) => {
  expect(() => {
    checkImageOptions(options);
  }).not.toThrow();
});

import { describe, expect, test, vi } from "vitest";
import type { Vec2, Vec3 } from "../../src/core/vec";
import { localFromUvd, uvdFromLocal } from "../../src/geo/axes";
import { pixelM, tileName, type Frame, type Tile } from "../../src/geo/frame";
import { readManifest, type LayerInfo, type View } from "../../src/geo/manifest";
import { PolygonIndex } from "../../src/geojson/polygonIndex";
import { fillHeights, drapedHeight } from "../../src/geojson/drape";
import { readGeojson } from "../../src/geojson/parse";
import { coordinateTransform } from "../../src/geojson/coordinates";
import { clipped, sectionsOf } from "../../src/geojson/lineSections";
import type { ImageLayer } from "../../src/map/imageLayer";
import { VisibleDepths } from "../../src/map/visibleDepths";
import { renderTown } from "../fixture/rendering";
import { ORIGIN, trace } from "../fixture/town";

// The tested files need only the errors of the viewer.
vi.mock("../../src/map3d", () => import("../../src/core/errors"));

const PIXELS = 32;
const town = renderTown(PIXELS, 1.52);
const rendering = readManifest(structuredClone(town.json), "town");

interface Made {
  opacity?: number;
  hidden?: number;
  /** A tile that is not in memory. */
  gone?: string;
}

/** A layer whose tiles are in memory. */
function layerOf({ opacity = 1, hidden, gone }: Made = {}): ImageLayer {
  const stored = (view: View, info: LayerInfo, tile: Tile): unknown => {
    const raw = tileName(tile) === gone ? undefined : town.raw.get(`${view.id}/${info.name}/${tileName(tile)}`);
    return (
      raw && {
        empty: false,
        data: { kind: info.name, width: PIXELS, height: PIXELS, values: new Uint32Array(raw.buffer, raw.byteOffset, raw.byteLength / 4) },
      }
    );
  };
  return {
    options: { opacity },
    rendering,
    drawStyles: hidden === undefined ? null : {},
    isHidden: (id: number) => id === hidden,
    findView: ({ id }: Frame) => rendering.views.get(id),
    tiles: { get: stored },
  } as unknown as ImageLayer;
}

function reliefOf(layers: readonly ImageLayer[], direction = "0-45"): VisibleDepths {
  const { frame } = rendering.views.get(direction) as View;
  return new VisibleDepths(layers, { camera: { frame, u: 0, v: 0, zoom: 3, width: 800, height: 600 }, origin: ORIGIN, dpr: 1, finer: 0 });
}

let state = 7;
const random = (low: number, high: number): number =>
  low + (high - low) * ((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32);
const PX = pixelM((rendering.views.get("0-45") as View).frame, 3);
const WHOLE: readonly [Vec2, Vec2] = [
  [-300, -300],
  [300, 300],
];

describe("relief", () => {
  test("depth is exact at each pixel, and infinite outside the model", () => {
    const relief = reliefOf([layerOf()]);
    const { frame } = relief.camera;
    for (let k = 0; k < 400; k++) {
      const [i, j] = [Math.floor(random(0, 8 * PIXELS)), Math.floor(random(0, 8 * PIXELS))];
      const [u, v] = [frame.u0 + (i + 0.5) * PX, frame.v0 - (j + 0.5) * PX];
      const hit = trace(frame, u, v);
      if (hit) expect(Math.abs(relief.depthAt(u, v) - frame.d0 - hit.d)).toBeLessThan(0.001);
      else expect(relief.depthAt(u, v)).toBe(Infinity);
    }
    expect(relief.depthAt(1e9, 0)).toBe(Infinity);
  });

  test.each(["0-45", "90-45"])("%s: points on the visible surface are not hidden, points well behind it are", (direction) => {
    const relief = reliefOf([layerOf()], direction);
    const { frame } = relief.camera;
    let tested = 0;
    for (let k = 0; k < 2000; k++) {
      const [u, v] = [random(-120, 120), random(-90, 110)];
      const centre = [
        frame.u0 + (Math.floor((u - frame.u0) / PX) + 0.5) * PX,
        frame.v0 - (Math.floor((frame.v0 - v) / PX) + 0.5) * PX,
      ] as const;
      const [hit, own] = [trace(frame, u, v), trace(frame, ...centre)];
      if (!hit || own?.id !== hit.id || own.normal.join() !== hit.normal.join()) continue; // a pixel on an edge shows one side of it
      expect(relief.isOccluded(u, v, frame.d0 + hit.d), `${String(u)} ${String(v)}`).toBe(false);
      expect(relief.isOccluded(u, v, frame.d0 + hit.d + 12 * PX)).toBe(true);
      tested++;
    }
    expect(tested).toBeGreaterThan(800);
  });

  test("hidden objects, invisible layers and unknown depths hide nothing; a missing tile is read from a level above", () => {
    const tower: Vec3 = [32, 40, 5];
    const covers = (...layers: ImageLayer[]): boolean =>
      reliefOf(layers).isPositionOccluded([ORIGIN[0] + tower[0], ORIGIN[1] + tower[1], ORIGIN[2] + tower[2]]);
    expect(covers(layerOf())).toBe(true);
    expect(covers(layerOf({ hidden: 2_000_000_001 }))).toBe(false);
    expect(covers(layerOf({ opacity: 0 }))).toBe(false);
    expect(covers(layerOf({ hidden: 2_000_000_001 }), layerOf())).toBe(true);
    expect(covers()).toBe(false);
    const { frame } = rendering.views.get("0-45") as View;
    const [u, v] = uvdFromLocal(frame.axes, tower);
    const [x, y] = [Math.floor((u - frame.u0) / (PX * PIXELS)), Math.floor((frame.v0 - v) / (PX * PIXELS))];
    expect(covers(layerOf({ gone: `3/${String(x)}/${String(y)}` })), "by the tile above").toBe(true);
    const [a, b] = [reliefOf([layerOf()]), reliefOf([layerOf()])];
    expect(a.sources(WHOLE).length).toBeGreaterThan(4);
    expect(a.sources(WHOLE).length).toBe(b.sources(WHOLE).length);
  });
});

describe("draping", () => {
  const relief = reliefOf([layerOf()]);
  test.each([
    [-80, -60, 0],
    [-45, -4, 34],
    [32, 26, 62],
    [30, -30, 16],
    [80, 70, 0],
    [500, 0, NaN],
  ] as const)("the draped height at %d, %d is %d", (x, y, height) => {
    const z = drapedHeight(relief, x, y);
    if (Number.isNaN(height)) expect(z).toBeNaN();
    else expect(z).toBeCloseTo(height, 1);
  });

  test("a point behind a building has height NaN, an unloaded one null", () => {
    expect(drapedHeight(relief, 32, 45)).toBeNaN();
    expect(drapedHeight(reliefOf([Object.assign(layerOf(), { tiles: { get: () => undefined } })]), 0, 0)).toBeNull();
  });

  test("missing heights are interpolated", () => {
    const points: Vec3[] = [
      [0, 0, NaN],
      [1, 0, 2],
      [2, 0, NaN],
      [3, 0, 4],
      [4, 0, NaN],
    ];
    expect(fillHeights(points)).toBe(true);
    expect(points.map(([, , z]) => z)).toEqual([2, 2, 3, 4, 4]);
    expect(fillHeights([[0, 0, NaN]])).toBe(false);
  });

  test("a draped line climbs over buildings and is hidden behind them", () => {
    const sections = sectionsOf(
      {
        points: [
          [-90, 26, NaN],
          [90, 26, NaN],
        ],
        draped: true,
      },
      relief,
      WHOLE,
      true,
    );
    const { axes } = relief.camera.frame;
    const [top] = [uvdFromLocal(axes, [32, 26, 62])];
    expect(sections.some(({ hidden, uv }) => !hidden && uv.some((value, k) => k % 2 === 1 && Math.abs(value - top[1]) < PX))).toBe(true);
    expect(
      sections.some(({ hidden, uv }) => hidden && (uv[0] ?? 0) < -55 && (uv.at(-2) ?? 0) > -35),
      "behind the hall",
    ).toBe(true);
  });
});

test("a line at a fixed height is hidden exactly where rays hit the model first", () => {
  const relief = reliefOf([layerOf()]);
  const { frame } = relief.camera;
  const [from, to] = (
    [
      [-90, 70, 12],
      [90, 70, 12],
    ] as const
  ).map((point) => uvdFromLocal(frame.axes, point)) as [Vec3, Vec3];
  const sections = sectionsOf(
    {
      points: [
        [-90, 70, 12],
        [90, 70, 12],
      ],
      draped: false,
    },
    relief,
    WHOLE,
    true,
  );
  let wrong = 0;
  for (let k = 0; k < 1000; k++) {
    const at = from.map((value, axis) => value + ((to[axis] as number) - value) * ((k + 0.5) / 1000)) as unknown as Vec3;
    const hit = trace(frame, at[0], at[1]);
    const hidden = hit !== null && frame.d0 + hit.d < at[2] - 0.1;
    const section = sections.find(
      ({ uv }) => at[0] >= Math.min(uv[0] ?? 0, uv.at(-2) ?? 0) && at[0] <= Math.max(uv[0] ?? 0, uv.at(-2) ?? 0),
    );
    if (section?.hidden !== hidden) wrong++;
  }
  expect(sections.filter(({ hidden }) => hidden).length).toBeGreaterThan(0);
  expect(wrong * (180 / 1000), "metres, of at most six ends").toBeLessThan(6 * PX);
});

describe("geometry", () => {
  test("segments are clipped to a rectangle", () => {
    const square = [
      [0, 0],
      [10, 10],
    ] as const;
    expect(clipped([-10, 5], [10, 5], square)).toEqual([0.5, 1]);
    expect(clipped([5, 5], [5, 5], square)).toEqual([0, 1]);
    expect(clipped([-5, 11], [15, 11], square)).toBeNull();
    expect(clipped([-1e300, 5], [1e300, 5], square)?.every(Number.isFinite) ?? true).toBe(true);
  });

  test("the index of a polygon with a hole agrees with the crossing sum over all edges", () => {
    const rings = [
      Array.from({ length: 57 }, (_, k): Vec2 => [Math.cos(k / 9.07) * (5 + (k % 3)), Math.sin(k / 9.07) * (5 + (k % 3))]),
      [
        [-1, -1],
        [1, -1],
        [1, 1],
        [-1, 1],
      ] as Vec2[],
    ];
    const area = new PolygonIndex(rings);
    const plain = (x: number, y: number): boolean =>
      rings
        .flatMap((ring) => ring.map((a, k) => [a, ring[(k + 1) % ring.length] as Vec2] as const))
        .filter(([[ax, ay], [bx, by]]) => ay > y !== by > y && x < ax + ((bx - ax) * (y - ay)) / (by - ay)).length %
        2 ===
      1;
    for (let k = 0; k < 3000; k++) {
      const [x, y] = [random(-8, 8), random(-8, 8)];
      expect(area.contains(x, y)).toBe(plain(x, y));
    }
    expect(area.contains(0, 0)).toBe(false);
    expect(
      new PolygonIndex([
        [
          [0, 0],
          [1, 0],
          [2, 0],
        ],
      ]).contains(1, 0),
    ).toBe(false);
  });
});

describe("GeoJSON", () => {
  const read = (data: unknown): ReturnType<typeof readGeojson> => readGeojson(data, true);
  test("reads all geometry types, holes, collections and foreign members", () => {
    const ring = [
      [0, 0],
      [1, 0],
      [1, 1],
      [0, 0],
    ];
    const { shapes, skipped } = read({
      type: "FeatureCollection",
      crs: { odd: true },
      features: [
        {
          type: "Feature",
          id: 7,
          properties: { a: 1 },
          foreign: 1,
          geometry: {
            type: "GeometryCollection",
            geometries: [
              { type: "Point", coordinates: [1, 2, 3, 4] },
              {
                type: "MultiLineString",
                coordinates: [
                  [
                    [0, 0],
                    [1, 1],
                  ],
                  [
                    [2, 2],
                    [3, 3],
                  ],
                ],
              },
            ],
          },
        },
        { type: "Feature", properties: null, geometry: { type: "MultiPolygon", coordinates: [[ring, ring], [ring]] } },
        { type: "Feature", properties: null, geometry: null },
      ],
    });
    expect([...skipped]).toEqual([]);
    expect(
      shapes.map(({ points, lines, polygons }) => [
        points.length,
        lines.length,
        polygons.map((rings) => rings.map((corners) => corners.length)),
      ]),
    ).toEqual([
      [1, 2, []],
      [0, 0, [[3, 3], [3]]],
    ]);
    expect(shapes[0]?.points[0]).toEqual([1, 2, 3]);
    expect(shapes[0]?.feature["foreign"]).toBe(1);
    expect(read({ type: "Point", coordinates: [1, 2] }).shapes[0]?.points[0]?.[2]).toBeNaN();
  });

  test("invalid geometries are skipped and counted; the others stay", () => {
    let deep: unknown = { type: "Point", coordinates: [0, 0] };
    for (let k = 0; k < 50_000; k++) deep = { type: "GeometryCollection", geometries: [deep] };
    const geometries: unknown[] = [
      { type: "Point", coordinates: [NaN, 0] },
      { type: "Point", coordinates: ["1", "2"] },
      { type: "Point", coordinates: [1e300, 0] },
      { type: "Point" },
      { type: "MultiPoint", coordinates: 5 },
      { type: "LineString", coordinates: [[0, 0]] },
      {
        type: "LineString",
        coordinates: [
          [0, 0],
          [0, 91],
        ],
      },
      { type: "LineString", coordinates: { length: 2, 0: [0, 0], 1: [1, 1] } },
      {
        type: "Polygon",
        coordinates: [
          [
            [0, 0],
            [1, 1],
            [0, 0],
          ],
        ],
      },
      { type: "Polygon", coordinates: [] },
      { type: "Circle", coordinates: [0, 0] },
      null,
      5,
      [],
      { type: "__proto__", coordinates: [] },
      deep,
    ];
    const features = [
      ...geometries.map((geometry) => ({
        type: "Feature",
        properties: JSON.parse('{"__proto__": {"polluted": true}, "name": "<img src=x onerror=alert(1)>"}') as unknown,
        geometry,
      })),
      5,
      null,
      { type: "feature" },
      { type: "Feature", properties: "text", geometry: { type: "Point", coordinates: [1, 2] } },
    ];
    const { shapes, skipped } = read({ type: "FeatureCollection", features });
    expect(shapes.length).toBe(1);
    expect(shapes[0]?.feature.properties).toBeNull();
    expect([...skipped.values()].reduce((sum, count) => sum + count, 0)).toBe(16 - 1 + 3);
    expect(({} as { polluted?: boolean }).polluted).toBeUndefined();
  });

  test.each([[null], [5], ["text"], [[]], [{ type: "Topology" }], [{ type: "FeatureCollection" }], [{}]])("%j is not GeoJSON", (data) => {
    expect(() => read(data)).toThrow(/GeoJSON must be/);
  });

  test("far coordinates are extrapolated linearly; without geographic coordinates there is an error", () => {
    const map = {
      lonLat: (): Vec2 => [11.5, 48.1],
      fromLonLat: ([lon, lat]: Vec2): Vec2 => [691000 + (lon - 11.5) * 75_000 + 1e3 * (lon - 11.5) ** 9, 5336000 + (lat - 48.1) * 111_000],
    };
    const place = coordinateTransform(map, ORIGIN, "lonlat");
    expect(place([11.51, 48.1, 520])?.map(Math.round)).toEqual([750, 0, 20]);
    const far = place([31.5, 48.1, NaN]) as Vec3;
    expect(far[0]).toBeGreaterThan(1.4e6);
    expect(far[0]).toBeLessThan(1.7e6);
    expect(place([371.51, 48.1, 520])?.map(Math.round)).toEqual([750, 0, 20]);
    expect(coordinateTransform(map, ORIGIN, "scene")([1e200, 0, 0])).toBeNull();
    expect(() => coordinateTransform({ lonLat: () => null, fromLonLat: () => null }, ORIGIN, "lonlat")).toThrow(/crs: "scene"/);
  });
});

test("local positions round-trip", () => {
  const { axes } = (rendering.views.get("0-45") as View).frame;
  expect(localFromUvd(axes, uvdFromLocal(axes, [1, 2, 3])).map((value) => Math.round(value * 1e9) / 1e9)).toEqual([1, 2, 3]);
});

import { describe, expect, test } from "vitest";
import { labelFeatures, nameOf } from "../../src/labels/fromGeoJson";
import { chooseLabels, type LabelBox } from "../../src/labels/layout";
import { properName } from "../../src/labels/label";

const box = (x: number, y: number, rank = 0, shown = false): LabelBox => ({ x, y, width: 60, height: 16, rank, shown });
const feature = (name: unknown, type: string, coordinates: unknown): object => ({
  type: "Feature",
  properties: { name },
  geometry: { type, coordinates },
});
const read = (...features: object[]): ReturnType<typeof labelFeatures> =>
  labelFeatures({ type: "FeatureCollection", features }, nameOf, ([lon, lat]) => [100 * lon, 100 * lat]);

describe("the layout", () => {
  test("shows labels that do not overlap, higher ranks first", () => {
    expect(chooseLabels([box(0, 0, 1), box(30, 5, 2), box(200, 0, 0)])).toEqual([false, true, true]);
    expect(chooseLabels([box(0, 0), box(65, 0), box(0, 21)])).toEqual([true, true, true]);
    expect(chooseLabels([box(0, 0), box(63, 0), box(0, 19)])).toEqual([true, false, false]);
  });

  test("keeps what is shown already, so that newcomers make nothing flicker", () => {
    expect(chooseLabels([box(0, 0, 1, true), box(30, 5, 9)])).toEqual([true, false]);
  });

  test("depends on the order of neither ranks nor input where nothing overlaps, and never shows overlapping ones", () => {
    const boxes = Array.from({ length: 300 }, (_, k) => box((k * 137) % 800, (k * 71) % 600, k % 7));
    const chosen = chooseLabels(boxes);
    const shown = boxes.filter((_, k) => chosen[k]);
    expect(shown.length).toBeGreaterThan(60);
    for (const [k, a] of shown.entries())
      for (const b of shown.slice(k + 1)) expect(Math.abs(a.x - b.x) >= 60 || Math.abs(a.y - b.y) >= 16).toBe(true);
  });
});

describe("names of GeoJSON", () => {
  test("stand at points, half-way along lines and in the middle of polygons", () => {
    const square = [
      [0, 0],
      [2, 0],
      [2, 2],
      [0, 2],
      [0, 0],
    ];
    expect(
      read(
        feature("Fountain", "Point", [1, 2, 7]),
        feature("Long Street", "LineString", [
          [0, 0],
          [1, 0],
          [4, 0],
        ]),
        feature("Market", "Polygon", [square]),
        feature("Parks", "MultiPolygon", [
          [
            [
              [9, 9],
              [9.1, 9],
              [9, 9.1],
            ],
          ],
          [square],
        ]),
      ).map(({ text, positions: [first], line }) => [text, ...first.map((part) => Math.round(part)), line]),
    ).toEqual([
      ["Fountain", 100, 200, 7, false],
      ["Long Street", 200, 0, NaN, true],
      ["Market", 100, 100, NaN, false],
      ["Parks", 100, 100, NaN, false],
    ]);
  });

  test("a line has other places along it, in case its middle is hidden", () => {
    expect(
      read(
        feature("Long Street", "LineString", [
          [0, 0],
          [1, 0],
          [4, 0],
        ]),
      )[0]?.positions.map(([x]) => Math.round(x)),
    ).toEqual([200, 140, 260, 80, 320]);
  });

  test("rank by extent; features without a name or with a broken geometry have none", () => {
    const [long, short] = read(
      feature("Long", "LineString", [
        [0, 0],
        [4, 0],
      ]),
      feature("Short", "LineString", [
        [0, 0],
        [1, 0],
      ]),
    );
    expect(long?.rank).toBeGreaterThan(short?.rank ?? NaN);
    expect(
      read(
        feature(undefined, "Point", [1, 2]),
        feature("DEBY_LOD2_4959793", "Point", [1, 2]),
        feature("a", "Point", ["x", 2]),
        feature("b", "LineString", []),
        feature("c", "GeometryCollection", []),
        { properties: { name: "d" }, geometry: null },
      ),
    ).toEqual([]);
  });

  test.each([[null], [{}], ["x"], [{ type: "Feature" }]])("%j is refused", (data) => {
    expect(() => labelFeatures(data, nameOf, () => null)).toThrow(
      /labels: expected an image layer, a URL or a FeatureCollection of GeoJSON/,
    );
  });
});

test.each([
  ["Rathaus", "Rathaus"],
  [" St. Moritz 3 ", "St. Moritz 3"],
  ["DEBY_LOD2_1", ""],
  ["UUID123", ""],
  [7, ""],
  [undefined, ""],
])("the proper name of %j is %j", (given, expected) => {
  expect(properName(given)).toBe(expected);
});

import { describe, expect, test } from "vitest";
import type { Vec3 } from "../../src/core/vec";
import { measureArea, measureLine } from "../../src/measure/geometry";
import { MeasureMessages } from "../../src/measure/i18n";

const ORIGIN: Vec3 = [691_000, 5_336_000, 500];
const at = (x: number, y: number, z: number): Vec3 => [ORIGIN[0] + x, ORIGIN[1] + y, ORIGIN[2] + z];

describe("lines", () => {
  test("of zero, one and two points", () => {
    expect(measureLine([])).toEqual({ length_m: 0, horizontal_m: 0, rise_m: 0, steps_m: [] });
    expect(measureLine([at(1, 2, 3)])).toEqual({ length_m: 0, horizontal_m: 0, rise_m: 0, steps_m: [] });
    expect(measureLine([at(0, 0, 0), at(2, 3, 6)])).toMatchObject({ length_m: 7, rise_m: 6, steps_m: [7] });
  });

  test("pass through all corners", () => {
    const line = measureLine([at(0, 0, 0), at(3, 4, 0), at(3, 4, 12), at(0, 0, 12)]);
    expect(line).toEqual({ length_m: 22, horizontal_m: 10, rise_m: 12, steps_m: [5, 12, 5] });
    expect(measureLine([at(0, 0, 5), at(0, 0, 2)]).rise_m).toBe(-3);
  });
});

describe("areas", () => {
  test("of fewer than three corners are zero", () => {
    for (const corners of [[], [at(0, 0, 0)], [at(0, 0, 0), at(4, 0, 0)]])
      expect(measureArea(corners)).toMatchObject({ area_m2: 0, footprint_m2: 0, normal: [0, 0, 0] });
    expect(measureArea([at(0, 0, 0), at(1, 0, 0), at(2, 0, 0)]).area_m2).toBe(0);
  });

  test("of a floor, a wall and a roof are exact to a millionth, far from the origin and in both orientations", () => {
    const floor = [at(0, 0, 0), at(6, 0, 0), at(6, 4, 0), at(3, 4, 0), at(3, 2, 0), at(0, 2, 0)];
    const wall = [at(0, 0, 0), at(3, 4, 0), at(3, 4, 10), at(0, 0, 10)];
    const roof = [at(0, 0, 0), at(8, 0, 0), at(8, 3, 3), at(0, 3, 3)];
    for (const turn of [(points: Vec3[]) => points, (points: Vec3[]) => [...points].reverse()]) {
      expect(measureArea(turn(floor))).toMatchObject({ area_m2: 18, footprint_m2: 18, slope_deg: 0, perimeter_m: 20, unevenness_m: 0 });
      expect(measureArea(turn(wall)).area_m2).toBeCloseTo(50, 6);
      expect(measureArea(turn(wall)).slope_deg).toBeCloseTo(90, 6);
      expect(measureArea(turn(roof)).area_m2).toBeCloseTo(24 * Math.SQRT2, 6);
      expect(measureArea(turn(roof)).slope_deg).toBeCloseTo(45, 6);
      expect(measureArea(turn(roof)).footprint_m2).toBeCloseTo(24, 6);
    }
  });

  test("report their unevenness", () => {
    expect(measureArea([at(0, 0, 0), at(10, 0, 0.2), at(10, 10, 0), at(0, 10, 0.2)]).unevenness_m).toBeCloseTo(0.1, 2);
  });
});

describe("formats", () => {
  const words = new MeasureMessages("en");
  test.each([
    [0, "0.00 m"],
    [12.345, "12.35 m"],
    [99.996, "100.0 m"],
    [999.96, "1.00 km"],
    [1234.5, "1.23 km"],
    [12_345, "12.3 km"],
  ])("%d m is %s", (metres, text) => {
    expect(words.length(metres)).toBe(text);
  });
  test.each([
    [3.456, "3.46 m²"],
    [123.45, "123.5 m²"],
    [1234, "1,234 m²"],
    [123_456, "12.35 ha"],
  ])("%d m² is %s", (area, text) => {
    expect(words.area(area)).toBe(text);
  });
  test("rise and fall in the user's number format", () => {
    expect(words.rise(-2.5)).toBe("↓ 2.50 m");
    expect(new MeasureMessages("de").rise(2.5)).toBe("↑ 2,50 m");
    expect(words.rise(0.004)).toBe("± 0.00 m");
    expect(words.rise(-0.004)).toBe("± 0.00 m");
    expect(words.rise(-0.006)).toBe("↓ 0.01 m");
  });
});

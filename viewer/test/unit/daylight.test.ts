import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { describe, expect, test } from "vitest";
import { getPosition } from "suncalc";
import type { Vec2, Vec3 } from "../../src/core/vec";
import { computeDaylight, computeSkyColors, chooseUtcOffset } from "../../src/geo/daylight";
import { localAzimuth, localFromLonLat, lonLatFromLocal, type GeographicJson } from "../../src/geo/geographic";
import { towardsLight } from "../../src/geo/light";
import type { LayerInfo } from "../../src/geo/manifest";
import { findShadow } from "../../src/geo/shadows";
import { PLACE } from "../fixture/town";

const { geographic, points } = JSON.parse(readFileSync(resolve(import.meta.dirname, "../../../spec/vectors/geographic.json"), "utf8")) as {
  geographic: GeographicJson;
  points: { local: Vec2; lon_lat: Vec2; back: Vec2 }[];
};

describe("positions on earth", () => {
  test.each(points)("$local converts to the longitude and latitude of the vectors, and back", ({ local, lon_lat, back }) => {
    const [lon, lat] = lonLatFromLocal(geographic, local);
    expect(((lon - lon_lat[0] + 540) % 360) - 180).toBeCloseTo(0, 10);
    expect(Math.abs(lon)).toBeLessThanOrEqual(180);
    expect(lat).toBeCloseTo(lon_lat[1], 10);
    localFromLonLat(geographic, [lon, lat]).forEach((part, k) => {
      expect(part).toBeCloseTo(back[k as 0], 6);
    });
  });

  test.each([
    [0, 358.086618],
    [90, 88.086618],
    [196.2, 194.286618],
    [275, 273.086618],
  ])("an azimuth of %d° is reduced by the meridian convergence in UTM", (azimuth, expected) => {
    expect(localAzimuth(PLACE, PLACE.lon_lat, azimuth)).toBeCloseTo(expected, 3);
  });
});

/** Computed by PyEphem 4.2, standard atmosphere: [latitude, longitude, time, azimuth, elevation]. */
const SUNS: [number, number, string, number, number][] = [
  [48.7665, 11.4258, "2026-06-21T13:00:00Z", 228.285057, 57.446563],
  [48.7665, 11.4258, "2026-12-21T15:10:00Z", 232.15772, 0.908969],
  [-33.8688, 151.2093, "2026-03-05T22:30:00Z", 73.329526, 32.716189],
  [40.7128, -74.006, "2030-10-12T18:00:00Z", 204.864626, 38.500421],
  [69.6492, 18.9553, "2027-06-10T23:30:00Z", 10.652045, 3.290796],
];

test.each(SUNS)("the sun over %d, %d at %s matches an almanac to a thirtieth of a degree", (lat, lon, time, azimuth, elevation) => {
  const sun = getPosition(new Date(time), lat, lon);
  expect(Math.abs(sun.azimuth - azimuth)).toBeLessThan(0.033);
  expect(Math.abs(sun.altitude - elevation)).toBeLessThan(0.033);
});

test("daylight comes from the sun's azimuth in the grid, white at noon and blue at night", () => {
  const noon = computeDaylight(new Date("2026-06-21T11:15:00Z"), PLACE);
  expect(noon.elevation_deg).toBeGreaterThan(64);
  expect(noon.sun_rgb).toEqual([1, 1, 1]);
  const night = computeDaylight(new Date("2026-06-21T23:00:00Z"), PLACE);
  expect(night.sun_rgb).toEqual([0, 0, 0]);
  expect(night.sky_rgb[2]).toBeGreaterThan(1.3 * night.sky_rgb[0]);
});

test("light increases with the sun's elevation, without jumps", () => {
  for (let elevation = -20; elevation < 60; elevation += 0.1) {
    const [low, high] = [computeSkyColors(elevation), computeSkyColors(elevation + 0.1)];
    high.sky_rgb.forEach((part, k) => {
      expect(part - low.sky_rgb[k as 0]).toBeGreaterThanOrEqual(-1e-12);
      expect(part - low.sky_rgb[k as 0]).toBeLessThan(0.02);
    });
    expect(Math.abs(high.sun_rgb[0] - low.sun_rgb[0])).toBeLessThan(0.04);
  }
});

test("clocks show the user's time zone near home and solar time elsewhere", () => {
  expect(chooseUtcOffset(11.4, 2)).toBe(2);
  expect(chooseUtcOffset(-8.6, 1)).toBe(1);
  expect(chooseUtcOffset(151.2, 1)).toBe(10);
});

describe("shadows that match a light", () => {
  const sun = (
    azimuth_deg: number,
    elevation_deg: number,
  ): { time: null; azimuth_deg: number; elevation_deg: number; direction: Vec3 } => ({
    time: null,
    azimuth_deg,
    elevation_deg,
    direction: towardsLight({ azimuth_deg, elevation_deg }),
  });
  const layer = (name: string, kind: string, suns: ReturnType<typeof sun>[]): LayerInfo => ({
    name,
    kind,
    format: "png",
    media_type: "image/png",
    suns,
  });
  const hours = layer("day", "sun16", [sun(90, 20), sun(110, 32), sun(135, 42), sun(165, 48)]);
  const noon = layer("noon", "sun", [sun(200, 50)]);
  const at = (azimuth_deg: number, elevation_deg: number): ReturnType<typeof findShadow> =>
    findShadow([hours, noon, layer("color", "color", [])], towardsLight({ azimuth_deg, elevation_deg }));

  test("a single sun if it is the light's", () => {
    expect(at(200, 50)).toMatchObject({ layer: noon, first: 0, second: 0, share: 0 });
    expect(at(200.5, 50.3)?.layer).toBe(noon);
    expect(at(204, 50)).toBeNull();
  });

  test("two hours of a day around the light, weighted by nearness", () => {
    const found = at(121.6, 37.6);
    expect(found).toMatchObject({ layer: hours, first: 1, second: 2 });
    expect(found?.share).toBeCloseTo(0.5, 1);
    expect(at(110, 32)?.share ?? 9).toBeLessThan(1e-6);
    expect(at(109.99, 32)).toMatchObject({ first: 0, second: 1 });
  });

  test("none for a light from another direction", () => {
    expect(at(300, 30)).toBeNull();
    expect(at(110, 55)).toBeNull();
    expect(at(90, 5)).toBeNull();
    expect(findShadow([], [0, 0, 1])).toBeNull();
  });
});

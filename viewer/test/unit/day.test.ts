import { expect, test } from "vitest";
import { getPosition } from "suncalc";
import { PLACE } from "../fixture/town";
import { findDay, type Day } from "../../page/day";

const dayOf = (lat: number, date: string, zone: number): Day =>
  findDay((hour) => getPosition(new Date(Date.parse(`${date}T00:00Z`) + (hour - zone) * 3_600_000), lat, PLACE.lon_lat[0]).altitude);

test("in Munich, the slider's day begins and ends at civil twilight, as an almanac has it", () => {
  const summer = dayOf(PLACE.lon_lat[1], "2026-06-21", 2);
  // dawn 4:33, sunrise 5:14, sunset 21:17, dusk 21:57
  [summer.dawn - 4.55, (summer.sunrise ?? 99) - 5.23, (summer.sunset ?? 99) - 21.28, summer.dusk - 21.95].forEach((error) => {
    expect(Math.abs(error)).toBeLessThan(0.1);
  });
  const winter = dayOf(PLACE.lon_lat[1], "2026-12-21", 1);
  // sunrise 8:01, sunset 16:22
  [(winter.sunrise ?? 99) - 8.02, (winter.sunset ?? 99) - 16.37].forEach((error) => {
    expect(Math.abs(error)).toBeLessThan(0.1);
  });
});

test("where the sun does not set, or does not rise, the day has all hours and no marks", () => {
  expect(dayOf(75, "2026-06-21", 1)).toEqual({ dawn: 0, dusk: 24, sunrise: null, sunset: null });
  expect(dayOf(80, "2026-12-21", 1)).toEqual({ dawn: 0, dusk: 24, sunrise: null, sunset: null });
});

test("in polar twilight the day lasts as long as it is light, without a sunrise; in white nights all hours are light", () => {
  const twilight = dayOf(70, "2026-12-21", 1);
  expect([twilight.sunrise, twilight.sunset]).toEqual([null, null]);
  expect(twilight.dawn).toBeGreaterThan(7);
  expect(twilight.dusk).toBeLessThan(17);
  expect(twilight.dusk - twilight.dawn).toBeGreaterThan(2);
  const white = dayOf(63, "2026-06-21", 2);
  expect([white.dawn, white.dusk]).toEqual([0, 24]);
  expect(white.sunrise).toBeGreaterThan(2);
  expect(white.sunset).not.toBeNull();
});

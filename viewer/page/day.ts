/** Hours of a day, in clock time. */
export interface Day {
  /** When the sun is 6° below the horizon: between dusk and dawn the light hardly changes. 0 and 24 where it never gets as dark, or never brighter. */
  readonly dawn: number;
  readonly dusk: number;
  /** null when the sun does not rise, or does not set. */
  readonly sunrise: number | null;
  readonly sunset: number | null;
}

/** The elevation of the sun's centre at civil dawn and dusk, and at sunrise and sunset, with the half degree that the air lifts it. */
const [TWILIGHT_DEG, HORIZON_DEG] = [-5.52, -0.27];
const STEPS_PER_HOUR = 12;

/** Finds a day's hours to five minutes. @param elevationAt returns the sun's elevation at an hour of the day, degrees */
export function findDay(elevationAt: (hour: number) => number): Day {
  const hours = Array.from({ length: 24 * STEPS_PER_HOUR + 1 }, (_, k) => k / STEPS_PER_HOUR);
  const elevations = hours.map(elevationAt);
  const isUp = (k: number, limit: number): boolean => (elevations[k] ?? NaN) >= limit;
  const bright = hours.filter((_, k) => isUp(k, TWILIGHT_DEG));
  const crossing = (rises: boolean): number | null =>
    hours.find((_, k) => k > 0 && isUp(k, HORIZON_DEG) === rises && isUp(k - 1, HORIZON_DEG) !== rises) ?? null;
  return { dawn: bright[0] ?? 0, dusk: bright.at(-1) ?? 24, sunrise: crossing(true), sunset: crossing(false) };
}

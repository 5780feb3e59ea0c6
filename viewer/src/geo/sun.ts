import type { Vec2 } from "../core/vec";

const { sin, cos, tan, asin, atan2, max } = Math;
const RAD = Math.PI / 180;
/** 2000-01-01, 12:00 UTC. */
const J2000_MS = 946_728_000_000;

/**
 * Computes where the sun stands: azimuth clockwise from true north, and altitude with the refraction of the standard atmosphere, degrees. Low-precision formulas of
 * the Astronomical Almanac, good to a fiftieth of a degree from 1950 to 2100; refraction by Saemundsson (Meeus, Astronomical Algorithms, 16.4).
 */
export function computeSunPosition(time: Date, [lon, lat]: Vec2): { azimuth_deg: number; altitude_deg: number } {
  const days = (time.getTime() - J2000_MS) / 86_400_000;
  // Ecliptic longitude, then right ascension and declination.
  const anomaly = (357.528 + 0.9856003 * days) * RAD;
  const longitude = (280.46 + 0.9856474 * days + 1.915 * sin(anomaly) + 0.02 * sin(2 * anomaly)) * RAD;
  const obliquity = (23.439 - 4e-7 * days) * RAD;
  const declination = asin(sin(obliquity) * sin(longitude));
  // Hour angle, from the sidereal time.
  const hour = (280.46061837 + 360.98564736629 * days + lon) * RAD - atan2(cos(obliquity) * sin(longitude), cos(longitude));
  const phi = lat * RAD;
  const altitude = asin(sin(phi) * sin(declination) + cos(phi) * cos(declination) * cos(hour)) / RAD;
  const lifted = max(altitude, 0);
  return {
    azimuth_deg: (atan2(sin(hour), cos(hour) * sin(phi) - tan(declination) * cos(phi)) / RAD + 540) % 360,
    altitude_deg: altitude + 0.017 / tan((lifted + 10.3 / (lifted + 5.11)) * RAD),
  };
}

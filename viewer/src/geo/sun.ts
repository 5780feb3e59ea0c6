import type { Vec2 } from "../core/vec";

const RAD = Math.PI / 180;
const DAY_MS = 864e5;
/** 2000-01-01T12:00Z. */
const J2000_MS = 946_728_000_000;
/** Terrestrial time minus UTC, as in the 2020s; ten seconds more or less move the sun by less than 0.001°. */
const DELTA_T_MS = 69_200;

/**
 * Computes the sun's azimuth (clockwise from north) and altitude over a place in degrees, with the refraction of the standard atmosphere; exact to 0.01° for centuries around 2000.
 * Meeus, Astronomical Algorithms: chapter 25, low accuracy; 12.4 for sidereal time; 16.4 for refraction.
 */
export function computeSunPosition(time: Date, [lon, lat]: Vec2): { azimuth_deg: number; altitude_deg: number } {
  const days = (time.getTime() - J2000_MS) / DAY_MS;
  const { rightAscension, declination } = computeSunCoordinates((days + DELTA_T_MS / DAY_MS) / 36_525);
  const [sin, cos] = [Math.sin, Math.cos];
  const hourAngle = RAD * (280.46061837 + 360.98564736629 * days + lon) - rightAscension;
  const phi = RAD * lat;
  const h = Math.asin(sin(phi) * sin(declination) + cos(phi) * cos(declination) * cos(hourAngle)) / RAD;
  const low = Math.max(h, 0);
  return {
    azimuth_deg: (Math.atan2(sin(hourAngle), cos(hourAngle) * sin(phi) - Math.tan(declination) * cos(phi)) / RAD + 540) % 360,
    altitude_deg: h + 0.017 / Math.tan(RAD * (low + 10.26 / (low + 5.1))),
  };
}

/** @param t Julian centuries since J2000, terrestrial time */
function computeSunCoordinates(t: number): { rightAscension: number; declination: number } {
  const anomaly = RAD * (357.52911 + 35_999.05029 * t);
  const center = (1.914602 - 0.004817 * t) * Math.sin(anomaly) + (0.019993 - 0.000101 * t) * Math.sin(2 * anomaly) + 0.000289 * Math.sin(3 * anomaly);
  const node = RAD * (125.04 - 1934.136 * t);
  const longitude = RAD * (280.46646 + t * (36_000.76983 + 0.0003032 * t) + center - 0.00569 - 0.00478 * Math.sin(node));
  const obliquity = RAD * (23.439291 - 0.0130042 * t + 0.00256 * Math.cos(node));
  return { rightAscension: Math.atan2(Math.cos(obliquity) * Math.sin(longitude), Math.cos(longitude)), declination: Math.asin(Math.sin(obliquity) * Math.sin(longitude)) };
}

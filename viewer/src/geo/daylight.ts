import { getPosition } from "suncalc";
import { clamp, type Vec3 } from "../core/vec";
import { localAzimuth, type GeographicJson } from "./geographic";
import type { Light } from "./light";

/** Computes sun and sky for a time at the scene's centre. */
export function computeDaylight(
  time: Date,
  geographic: GeographicJson,
): Pick<Light, "azimuth_deg" | "elevation_deg" | "sun_rgb" | "sky_rgb"> {
  const [lon, lat] = geographic.lon_lat;
  const { azimuth, altitude: elevation_deg } = getPosition(time, lat, lon);
  return { azimuth_deg: localAzimuth(geographic, [lon, lat], azimuth), elevation_deg, ...computeSkyColors(elevation_deg) };
}

/**
 * Computes the colours of sun and sky from the sun's elevation: white at noon, warm near the horizon, blue after sunset. The light left at night
 * keeps the town recognisable, as in a long exposure.
 */
export function computeSkyColors(elevation_deg: number): { sun_rgb: Vec3; sky_rgb: Vec3 } {
  const at = (table: readonly ColorStop[]): Vec3 => {
    const next = table.findIndex(([elevation]) => elevation >= elevation_deg);
    const [high, low] = [
      table[next < 0 ? table.length - 1 : next] as ColorStop,
      table[Math.max((next < 0 ? table.length : next) - 1, 0)] as ColorStop,
    ];
    const share = high[0] === low[0] ? 0 : clamp((elevation_deg - low[0]) / (high[0] - low[0]), 0, 1);
    return [0, 1, 2].map((k) => low[1][k as 0] + (high[1][k as 0] - low[1][k as 0]) * share) as unknown as Vec3;
  };
  return { sun_rgb: at(SUN), sky_rgb: at(SKY) };
}

type ColorStop = readonly [elevation_deg: number, rgb: Vec3];

const WHITE: Vec3 = [1, 1, 1];
/** Factors of the diffuse light, by elevation. */
const SUN: readonly ColorStop[] = [
  [-1, [0, 0, 0]],
  [0.5, [0.42, 0.17, 0.06]],
  [4, [0.92, 0.58, 0.3]],
  [12, [1.04, 0.88, 0.68]],
  [30, WHITE],
];
/** Factors of the ambient light, by elevation. */
const SKY: readonly ColorStop[] = [
  [-12, [0.44, 0.5, 0.7]],
  [-6, [0.48, 0.54, 0.72]],
  [0, [0.6, 0.62, 0.74]],
  [8, [0.9, 0.93, 1]],
  [30, WHITE],
];

/** Returns the UTC offset, in hours, for clocks at a longitude: the browser's own if it is plausible there, else the offset of solar time. */
export function chooseUtcOffset(lon: number, browser_h: number): number {
  return Math.abs(browser_h - lon / 15) <= MAX_OFFSET_FROM_SUN_H ? browser_h : Math.round(lon / 15);
}

/** Official time differs from solar time by at most this much. */
const MAX_OFFSET_FROM_SUN_H = 2.6;

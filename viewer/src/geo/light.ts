import { clamp, type Vec3 } from "../core/vec";

export interface Light {
  /** false: colours are shown as they are stored. */
  lit: boolean;
  /** Where the light comes from, degrees clockwise from north. */
  azimuth_deg: number;
  /** Degrees above the horizon. */
  altitude_deg: number;
  /** Light everywhere, 0..1. */
  ambient: number;
  /** Light on a surface that faces the sun; linear light, added to ambient. */
  diffuse: number;
}

export const DEFAULT_LIGHT: Readonly<Light> = { lit: true, azimuth_deg: 215, altitude_deg: 48, ambient: 0.42, diffuse: 0.76 };

/** Unit vector towards the light, local axes. */
export function towardsLight({ azimuth_deg, altitude_deg }: Pick<Light, "azimuth_deg" | "altitude_deg">): Vec3 {
  const [azimuth, altitude] = [(azimuth_deg * Math.PI) / 180, (altitude_deg * Math.PI) / 180];
  return [Math.sin(azimuth) * Math.cos(altitude), Math.cos(azimuth) * Math.cos(altitude), Math.sin(altitude)];
}

/** Linear light on a unit normal. */
export function lambert(light: Light, normal: Vec3): number {
  const l = towardsLight(light);
  return light.ambient + light.diffuse * Math.max(0, normal[0] * l[0] + normal[1] * l[1] + normal[2] * l[2]);
}

/** The light with numbers brought into their ranges. */
export function validLight(light: Light): Light {
  return {
    lit: light.lit,
    azimuth_deg: ((light.azimuth_deg % 360) + 360) % 360,
    altitude_deg: clamp(light.altitude_deg, -90, 90),
    ambient: clamp(light.ambient, 0, 1),
    diffuse: clamp(light.diffuse, 0, 4),
  };
}

import { checkOptions, checkVector } from "../core/check";
import { clamp, type Vec3 } from "../core/vec";

/** Lambertian light: directional sunlight and ambient skylight. */
export interface Light {
  /** false: colours are shown as stored. */
  lit: boolean;
  /** Azimuth of the light source, degrees clockwise from north. */
  azimuth_deg: number;
  /** Degrees above the horizon. */
  elevation_deg: number;
  /** Ambient light, 0..1. */
  ambient: number;
  /** Light on a surface that faces the sun, added to ambient; linear. */
  diffuse: number;
  /** Colour of the sunlight: factors of diffuse. */
  sun_rgb: Vec3;
  /** Colour of the skylight: factors of ambient. */
  sky_rgb: Vec3;
  /** Shows shadows from the layers sun and sun16 where they match the sun's position. */
  shadows: boolean;
  /** Darkens ambient light by the layer ao. */
  occlusion: boolean;
}

export const DEFAULT_LIGHT: Readonly<Light> = {
  lit: true,
  azimuth_deg: 215,
  elevation_deg: 48,
  ambient: 0.42,
  diffuse: 0.76,
  sun_rgb: [1, 1, 1],
  sky_rgb: [1, 1, 1],
  shadows: true,
  occlusion: true,
};

/** Unit vector towards the light, local axes. */
export function towardsLight({ azimuth_deg, elevation_deg }: Pick<Light, "azimuth_deg" | "elevation_deg">): Vec3 {
  const [azimuth, elevation] = [(azimuth_deg * Math.PI) / 180, (elevation_deg * Math.PI) / 180];
  return [Math.sin(azimuth) * Math.cos(elevation), Math.cos(azimuth) * Math.cos(elevation), Math.sin(elevation)];
}

/** Clamps a light's numbers to their ranges. @throws UsageError for unknown names, and for anything but finite numbers */
export function clampLight(light: Light): Light {
  checkOptions(light, Object.keys(DEFAULT_LIGHT));
  for (const name of ["azimuth_deg", "elevation_deg", "ambient", "diffuse"] as const) checkVector([light[name]], name, "a number", 1);
  for (const name of ["sun_rgb", "sky_rgb"] as const) checkVector(light[name], name, "three numbers");
  return {
    lit: light.lit,
    azimuth_deg: ((light.azimuth_deg % 360) + 360) % 360,
    elevation_deg: clamp(light.elevation_deg, -90, 90),
    ambient: clamp(light.ambient, 0, 1),
    diffuse: clamp(light.diffuse, 0, 4),
    sun_rgb: light.sun_rgb.map((part) => clamp(part, 0, 4)) as unknown as Vec3,
    sky_rgb: light.sky_rgb.map((part) => clamp(part, 0, 4)) as unknown as Vec3,
    shadows: light.shadows,
    occlusion: light.occlusion,
  };
}

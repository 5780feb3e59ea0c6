import { dot, type Vec3 } from "../core/vec";
import type { LayerInfo } from "./manifest";

/** The rendered suns that match a light: one, or two between which the light lies. */
export interface Shadow {
  readonly layer: LayerInfo;
  /** Indices of the suns in the layer; equal for a single sun. */
  readonly first: number;
  readonly second: number;
  /** Weight of the second, 0..1. */
  readonly share: number;
}

/** Greatest angle between a light and a matching single sun. Shadows of a 30 m house with the sun at 30° are then off by less than half a metre. */
const SAME_RAD = (0.6 * Math.PI) / 180;
/** Greatest angle between a light and the arc that joins two suns of a day: about three weeks in spring, or 20 minutes beyond its ends. */
const NEAR_RAD = (5 * Math.PI) / 180;

/** Finds the layer and suns that match a light best; null when none does. @param towards unit vector towards the light, local axes */
export function findShadow(layers: readonly LayerInfo[], towards: Vec3): Shadow | null {
  let best: Shadow | null = null;
  let minAngle = Infinity;
  for (const layer of layers) {
    const suns = layer.suns?.map(({ direction }) => direction) ?? [];
    const isSeries = layer.kind === "sun16";
    for (const [first, sun] of layer.kind === "sun" || isSeries ? suns.entries() : []) {
      const next = suns[first + 1];
      const [distance, share] = isSeries && next ? measureArc(sun, next, towards) : [angle(sun, towards), 0];
      if (distance >= minAngle || distance > (isSeries ? NEAR_RAD : SAME_RAD)) continue;
      [minAngle, best] = [distance, { layer, first, second: share > 0 ? first + 1 : first, share }];
    }
  }
  return best;
}

/** Measures how far a vector is from the arc between two others, and its position along the arc. */
function measureArc(from: Vec3, to: Vec3, towards: Vec3): [apart_rad: number, share: number] {
  const arc = angle(from, to);
  const normal = cross(from, to);
  const length = Math.hypot(...normal);
  if (length < 1e-9) return [angle(from, towards), 0];
  const offset = dot(normal, towards) / length;
  const along = Math.atan2(dot(cross(normal, from), towards) / length, dot(from, towards));
  const share = Math.min(Math.max(along / arc, 0), 1);
  return [Math.hypot(Math.asin(Math.min(Math.abs(offset), 1)), along - share * arc), share];
}

/** Computes the angle between two unit vectors; accurate for small angles, too. */
const angle = (a: Vec3, b: Vec3): number => Math.atan2(Math.hypot(...cross(a, b)), dot(a, b));

const cross = (a: Vec3, b: Vec3): Vec3 => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

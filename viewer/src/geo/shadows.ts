import { dot, type Vec3 } from "../core/vec";
import type { LayerInfo } from "./manifest";

/** Suns of a rendered layer whose shadows are those of a light: one, or two between which the light stands. */
export interface Shadow {
  readonly layer: LayerInfo;
  /** Numbers of suns; the same twice for a single one. */
  readonly first: number;
  readonly second: number;
  /** Of the second, 0..1. */
  readonly share: number;
}

/** A single sun is the light's when it is so near. Shadows of a house of 30 m with the sun at 30° are then off by less than half a metre. */
const SAME_RAD = (0.6 * Math.PI) / 180;
/** So far from the way between two suns of a day, and beyond its ends. Some three weeks in spring, and 20 minutes. */
const NEAR_RAD = (5 * Math.PI) / 180;

/** The layer and suns that suit a light best; null when none does. `towards`: unit vector towards the light, local axes. */
export function findShadow(layers: readonly LayerInfo[], towards: Vec3): Shadow | null {
  let best: Shadow | null = null;
  let least = Infinity;
  for (const layer of layers) {
    const suns = layer.suns?.map(({ direction }) => direction) ?? [];
    const many = layer.kind === "sun16";
    for (const [first, sun] of layer.kind === "sun" || many ? suns.entries() : []) {
      const next = suns[first + 1];
      const [apart, share] = many && next ? measureArc(sun, next, towards) : [angle(sun, towards), 0];
      if (apart >= least || apart > (many ? NEAR_RAD : SAME_RAD)) continue;
      [least, best] = [apart, { layer, first, second: share > 0 ? first + 1 : first, share }];
    }
  }
  return best;
}

/** How far a direction is from the way between two, and how far along it. */
function measureArc(from: Vec3, to: Vec3, towards: Vec3): [apart_rad: number, share: number] {
  const whole = angle(from, to);
  const normal = cross(from, to);
  const length = Math.hypot(...normal);
  if (length < 1e-9) return [angle(from, towards), 0];
  const beside = dot(normal, towards) / length;
  const along = Math.atan2(dot(cross(normal, from), towards) / length, dot(from, towards));
  const share = Math.min(Math.max(along / whole, 0), 1);
  return [Math.hypot(Math.asin(Math.min(Math.abs(beside), 1)), along - share * whole), share];
}

/** Good for small angles, too. */
const angle = (a: Vec3, b: Vec3): number => Math.atan2(Math.hypot(...cross(a, b)), dot(a, b));

const cross = (a: Vec3, b: Vec3): Vec3 => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

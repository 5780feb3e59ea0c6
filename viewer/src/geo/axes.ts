import { dot, type Vec2, type Vec3 } from "../core/vec";

/** The axes of a view in local coordinates: right, up, and forward (away from the viewer). Orthonormal. */
export interface Axes {
  readonly right: Vec3;
  readonly up: Vec3;
  readonly forward: Vec3;
}

const EXACT: Record<number, Vec2> = { 0: [1, 0], 90: [0, 1], 180: [-1, 0], 270: [0, -1] };
const HALF_SIN: Record<number, number> = { 30: 0.5, 150: 0.5, 210: -0.5, 330: -0.5 };
const HALF_COS: Record<number, number> = { 60: 0.5, 300: 0.5, 120: -0.5, 240: -0.5 };

/** Returns cosine and sine of an angle; exact at multiples of 90° and where one of them is ±½. */
export function cosSin(deg: number): Vec2 {
  const turn = ((deg % 360) + 360) % 360;
  const rad = (turn * Math.PI) / 180;
  return EXACT[turn] ?? [HALF_COS[turn] ?? Math.cos(rad), HALF_SIN[turn] ?? Math.sin(rad)];
}

/** Computes the axes of a view from its look-at angle (counter-clockwise from north) and pitch (below the horizon), in degrees. spec/pyramid.md §1. */
export function computeAxes(lookAt_deg: number, pitch_deg: number): Axes {
  const [ca, sa] = cosSin(lookAt_deg);
  const [cp, sp] = cosSin(pitch_deg);
  return { right: [ca, sa, 0], up: [-sp * sa, sp * ca, cp], forward: [-cp * sa, cp * ca, -sp] };
}

/** Returns a view's id in its shortest decimal form, e.g. `45-22.5`. */
export function viewId(lookAt_deg: number, pitch_deg: number): string {
  return `${String(lookAt_deg)}-${String(pitch_deg)}`;
}

/** Transforms a local point to view coordinates U, V, D (metres). */
export function uvdFromLocal({ right, up, forward }: Axes, local: Vec3): Vec3 {
  return [dot(right, local), dot(up, local), dot(forward, local)];
}

export function localFromUvd({ right, up, forward }: Axes, [u, v, d]: Vec3): Vec3 {
  return [u * right[0] + v * up[0] + d * forward[0], u * right[1] + v * up[1] + d * forward[1], u * right[2] + v * up[2] + d * forward[2]];
}

/** Returns D of the point with this V and local height z; null when the view is level. */
export function depthAtHeight({ up, forward }: Axes, v: number, z: number): number | null {
  return Math.abs(forward[2]) < 1e-9 ? null : (z - v * up[2]) / forward[2];
}

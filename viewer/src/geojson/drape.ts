import type { Vec3 } from "../core/vec";
import type { VisibleDepths } from "../map3d";

/** A point this far above a surface counts as on it, in pixels and metres, so that lines along a wall stay on one edge of it. */
const ON_PX = 1.5;
const ON_M = 0.05;
/** Steepest surface: metres of depth per metre across the screen. */
const MAX_SLOPE = 8;

/**
 * Returns the local height of the highest visible surface at a horizontal position; NaN where it is hidden or missing, null where it is not known yet.
 * Steps down the vertical, pixel by pixel. A continuous crossing of the visible surface is the answer; a jump of the surface in front of the vertical means that
 * the point is hidden.
 */
export function drapedHeight(relief: VisibleDepths, x: number, y: number): number | null {
  const { axes, v0 } = relief.camera.frame;
  const { right, up, forward } = axes;
  const px = relief.pixel_m;
  const [u, v, d] = [right[0] * x + right[1] * y, up[0] * x + up[1] * y, forward[0] * x + forward[1] * y];
  if (up[2] < 1e-6) return fromAbove(relief.depthAt(u, v), d, forward[2]);
  const on = ON_PX * px + ON_M;
  const jump = (MAX_SLOPE - forward[2] / up[2]) * px + on;
  const [lowest, highest] = relief.heights;
  const last = Math.ceil((v0 - v - lowest * up[2]) / px);
  let [clear, before, zBefore, known] = [true, Infinity, Infinity, true];
  for (let j = Math.floor((v0 - v - highest * up[2]) / px) - 1; j <= last; j++) {
    const at = v0 - (j + 0.5) * px;
    const z = (at - v) / up[2];
    const above = relief.depthAt(u, at) - d - z * forward[2];
    if (Number.isNaN(above)) known = false;
    else if (clear && above <= on && above >= -jump)
      return crosses(before, above, jump)
        ? zBefore + ((z - zBefore) * before) / (before - above)
        : refineContact(relief, { u, v, d }, j, above, jump);
    else clear = above > on;
    [before, zBefore] = [above, z];
  }
  return known ? NaN : null;
}

const fromAbove = (depth: number, d: number, forward: number): number | null =>
  Number.isNaN(depth) ? null : Number.isFinite(depth) ? (depth - d) / forward : NaN;

/** Does the point pass from above the surface to below it, without a jump? */
const crosses = (before: number, above: number, jump: number): boolean => above <= 0 && before > 0 && before - above <= jump;

/** Returns the height at which a point slightly above the surface, or on an edge, touches it. */
function refineContact(
  relief: VisibleDepths,
  { u, v, d }: { u: number; v: number; d: number },
  j: number,
  above: number,
  jump: number,
): number {
  const {
    axes: { up, forward },
    v0,
  } = relief.camera.frame;
  const zAt = (row: number): number => (v0 - (row + 0.5) * relief.pixel_m - v) / up[2];
  const [here, below] = [zAt(j), zAt(j + 1)];
  if (above <= 0) return here;
  const next = relief.depthAt(u, v0 - (j + 1.5) * relief.pixel_m) - d - below * forward[2];
  return crosses(above, next, jump) ? here + ((below - here) * above) / (above - next) : here;
}

/** Fills missing heights: interpolates between neighbours and extends the ends. @returns false when no height is known */
export function fillHeights(points: Vec3[]): boolean {
  let last = -1;
  for (let k = 0; k < points.length; k++) {
    const z = points[k]?.[2] ?? NaN;
    if (Number.isNaN(z)) continue;
    const from = last < 0 ? z : (points[last]?.[2] ?? z);
    for (let gap = last + 1; gap < k; gap++)
      points[gap] = withHeight(points[gap] as Vec3, last < 0 ? z : from + ((z - from) * (gap - last)) / (k - last));
    last = k;
  }
  if (last < 0) return false;
  const end = points[last]?.[2] ?? 0;
  for (let k = last + 1; k < points.length; k++) points[k] = withHeight(points[k] as Vec3, end);
  return true;
}

const withHeight = ([x, y]: Vec3, z: number): Vec3 => [x, y, z];

import { add, clamp, dot, sub, type Vec2, type Vec3 } from "../core/vec";
import type { Axes } from "../geo/axes";
import type { Map3D, VisibleDepths } from "../map3d";

/** Heights of the visible surface along a line: the upper outline of a vertical section. */
export interface Profile {
  /** Horizontal distances from the first point; metres. */
  readonly distances_m: Float64Array;
  /** Heights in the scene's CRS, metres; NaN where the surface is hidden or missing. */
  readonly heights_m: Float64Array;
  /** Read above the deepest level, or only from tiles in memory. */
  readonly approximate: boolean;
}

/** Options of `measureProfile`. */
export interface ProfileOptions {
  /** Number of samples along the line, 2 to 10,000. Default 400. */
  samples?: number;
  /** Aborts the measurement. Default: none. */
  signal?: AbortSignal;
}

/** Maximum number of depth tiles per part of a line, and of parts. */
const MAX_TILES = 24;
const PARTS = 8;
/** Largest change of D between rows on one surface, in pixels. */
const MAX_STEP_PX = 12;

/** Measures heights along a line through points (world; their heights are ignored), in the current view. @throws the signal's reason */
export async function measureProfile(
  map: Map3D,
  points: readonly Vec3[],
  { samples = 400, signal }: ProfileOptions = {},
): Promise<Profile> {
  const places = samplePoints(points, clamp(Math.round(samples), 2, 10_000));
  const heights_m = new Float64Array(places.length).fill(NaN);
  const distances_m = Float64Array.from(places, ({ distance_m }) => distance_m);
  const state = map.getViewState();
  if (!state || points.length < 2) return { distances_m, heights_m, approximate: false };
  const { axes } = state.camera.frame;
  const span = map.visibleDepths?.heights ?? [0, 0];
  const size = Math.ceil(places.length / PARTS);
  let approximate = false;
  for (let first = 0; first < places.length; first += size) {
    signal?.throwIfAborted();
    const part = places.slice(first, first + size).map(({ position }) => sub(position, state.origin));
    const corners = part.flatMap((position) =>
      span.map((z): Vec2 => [dot(axes.right, position), horizontalDot(axes.up, position) + axes.up[2] * z]),
    );
    const rect = [
      [minimum(corners, 0), minimum(corners, 1)],
      [-minimum(corners, 0, -1), -minimum(corners, 1, -1)],
    ] as const;
    const found = await map.fetchDepths(state, rect, MAX_TILES);
    approximate ||= found.approximate;
    part.forEach((position, k) => {
      heights_m[first + k] = heightAt(found.relief, axes, position, span) + state.origin[2];
    });
  }
  return { distances_m, heights_m, approximate };
}

/** Returns positions at equal horizontal distances from the first point to the last. */
export function samplePoints(points: readonly Vec3[], samples: number): { position: Vec3; distance_m: number }[] {
  const steps = points.slice(1).map((point, k) => Math.hypot(point[0] - (points[k] as Vec3)[0], point[1] - (points[k] as Vec3)[1]));
  const length = steps.reduce((sum, step) => sum + step, 0);
  let [corner, before] = [0, 0];
  return Array.from({ length: points.length < 2 ? 0 : samples }, (_, k) => {
    const distance_m = (length * k) / (samples - 1);
    while (corner < steps.length - 1 && distance_m > before + (steps[corner] ?? 0)) before += steps[corner++] ?? 0;
    const [from, to, step] = [points[corner] as Vec3, points[corner + 1] as Vec3, steps[corner] ?? 0];
    const share = step > 0 ? Math.min((distance_m - before) / step, 1) : 0;
    return { position: add(from, [(to[0] - from[0]) * share, (to[1] - from[1]) * share, 0]), distance_m };
  });
}

/**
 * Returns the greatest local height at which the vertical through a position meets the visible surface; NaN if it does not. On the screen the vertical is a
 * column of pixels. From the top down, it meets the surface where the surface changes continuously from behind the vertical to in front of it.
 */
export function heightAt(
  relief: Pick<VisibleDepths, "depthAt" | "pixel_m">,
  { right, up, forward }: Axes,
  position: Vec3,
  [low, high]: Vec2,
): number {
  const [u, v0, d0] = [dot(right, position), horizontalDot(up, position), horizontalDot(forward, position)];
  if (up[2] < 1e-6) {
    const depth = relief.depthAt(u, v0);
    return Number.isFinite(depth) ? (depth - d0) / forward[2] : NaN;
  }
  const step = relief.pixel_m / up[2];
  // Distance of the visible surface behind the vertical at height z.
  const behind = (z: number): number => relief.depthAt(u, v0 + up[2] * z) - (d0 + forward[2] * z);
  let above = behind(high + step);
  for (let z = high; z >= low - step; z -= step) {
    const here = behind(z);
    if (above >= 0 && here <= 0 && above - here <= MAX_STEP_PX * relief.pixel_m)
      return above === here ? z : z + (step * -here) / (above - here);
    above = here;
  }
  return NaN;
}

const horizontalDot = (axis: Vec3, position: Vec3): number => axis[0] * position[0] + axis[1] * position[1];

/** Returns the least coordinate times `sign`. */
const minimum = (points: readonly Vec2[], k: 0 | 1, sign = 1): number =>
  points.reduce((best, point) => Math.min(best, sign * point[k]), Infinity);

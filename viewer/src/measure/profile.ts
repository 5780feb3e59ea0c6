import { add, clamp, dot, sub, type Vec2, type Vec3 } from "../core/vec";
import type { Axes } from "../geo/axes";
import type { map, Relief } from "../map3d";

/** Heights along a line over the surface that is seen: what a vertical cut through the model shows from above. */
export interface Profile {
  /** Seen from above, from the first point on; metres. */
  readonly distances_m: Float64Array;
  /** Of the CRS, metres; NaN where the surface is hidden, or nothing is there. */
  readonly heights_m: Float64Array;
  /** Read above the deepest level, or from what was in memory when tiles could not be had. */
  readonly approximate: boolean;
}

/** How finely, and until when, heights are read. */
export interface ProfileOptions {
  /** Places along the line; 400 when left out. 2 to 10,000. */
  samples?: number;
  signal?: AbortSignal;
}

/** Depth tiles that a part of a line may take, and its parts. */
const TILES = 24;
const PARTS = 8;
/** Of one surface, D may change by so many pixels from a row to the next. */
const STEEPEST = 12;

/** Heights along a line from point to point (world; their own heights do not count), in the view that the map shows. @throws the signal's reason */
export async function measureProfile(map: map, points: readonly Vec3[], { samples = 400, signal }: ProfileOptions = {}): Promise<Profile> {
  const places = along(points, clamp(Math.round(samples), 2, 10_000));
  const heights_m = new Float64Array(places.length).fill(NaN);
  const distances_m = Float64Array.from(places, ({ distance_m }) => distance_m);
  const sight = map.getViewState();
  if (!sight || points.length < 2) return { distances_m, heights_m, approximate: false };
  const { axes } = sight.camera.frame;
  const span = map.relief?.heights ?? [0, 0];
  const size = Math.ceil(places.length / PARTS);
  let approximate = false;
  for (let first = 0; first < places.length; first += size) {
    signal?.throwIfAborted();
    const part = places.slice(first, first + size).map(({ place }) => sub(place, sight.origin));
    const corners = part.flatMap((place) => span.map((z): Vec2 => [dot(axes.right, place), flat(axes.up, place) + axes.up[2] * z]));
    const rect = [[least(corners, 0), least(corners, 1)], [-least(corners, 0, -1), -least(corners, 1, -1)]] as const;
    const found = await map.fetchRelief(sight, rect, TILES);
    approximate ||= found.approximate;
    part.forEach((place, k) => { heights_m[first + k] = heightAt(found.relief, axes, place, span) + sight.origin[2]; });
  }
  return { distances_m, heights_m, approximate };
}

/** Places at equal distances from the first point to the last, seen from above. */
export function along(points: readonly Vec3[], samples: number): { place: Vec3; distance_m: number }[] {
  const steps = points.slice(1).map((point, k) => Math.hypot(point[0] - (points[k] as Vec3)[0], point[1] - (points[k] as Vec3)[1]));
  const length = steps.reduce((sum, step) => sum + step, 0);
  let [corner, before] = [0, 0];
  return Array.from({ length: points.length < 2 ? 0 : samples }, (_, k) => {
    const distance_m = (length * k) / (samples - 1);
    while (corner < steps.length - 1 && distance_m > before + (steps[corner] ?? 0)) before += steps[corner++] ?? 0;
    const [from, to, step] = [points[corner] as Vec3, points[corner + 1] as Vec3, steps[corner] ?? 0];
    const share = step > 0 ? Math.min((distance_m - before) / step, 1) : 0;
    return { place: add(from, [(to[0] - from[0]) * share, (to[1] - from[1]) * share, 0]), distance_m };
  });
}

/**
 * Greatest height, local, at which a surface that is seen lies on the vertical through a place; NaN: none is seen. The vertical is a column of the
 * picture: row by row from above, the surface is met where what is seen turns from behind the vertical to before it, and goes on.
 */
export function heightAt(relief: Pick<Relief, "depthAt" | "pixel_m">, { right, up, forward }: Axes, place: Vec3, [low, high]: Vec2): number {
  const [u, v0, d0] = [dot(right, place), flat(up, place), flat(forward, place)];
  if (up[2] < 1e-6) {
    const depth = relief.depthAt(u, v0);
    return Number.isFinite(depth) ? (depth - d0) / forward[2] : NaN;
  }
  const step = relief.pixel_m / up[2];
  // How far what is seen lies behind the vertical: rays meet it at z.
  const behind = (z: number): number => relief.depthAt(u, v0 + up[2] * z) - (d0 + forward[2] * z);
  let above = behind(high + step);
  for (let z = high; z >= low - step; z -= step) {
    const here = behind(z);
    if (above >= 0 && here <= 0 && above - here <= STEEPEST * relief.pixel_m) return above === here ? z : z + (step * -here) / (above - here);
    above = here;
  }
  return NaN;
}

const flat = (axis: Vec3, place: Vec3): number => axis[0] * place[0] + axis[1] * place[1];

/** Of a coordinate times `sign`. */
const least = (points: readonly Vec2[], k: 0 | 1, sign = 1): number => points.reduce((best, point) => Math.min(best, sign * point[k]), Infinity);

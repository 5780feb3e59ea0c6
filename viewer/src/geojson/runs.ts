import type { Vec2, Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import type { Relief } from "../map3d";
import { fillHeights, landing } from "./drape";

/** [[least U, least V], [greatest U, greatest V]], metres. */
export type Rect = readonly [Vec2, Vec2];

/** A line over the ground; local positions. */
export interface Path {
  readonly points: readonly Vec3[];
  /** Its heights are those of the surface that is seen. */
  readonly draped: boolean;
}

/** A stretch of a line that is seen, or hidden. */
export interface Run {
  readonly hidden: boolean;
  /** U and V in turn. */
  readonly uv: number[];
}

/** The stretches of a line that lie in a rectangle, in order. @param occluded false: all of it counts as seen */
export function runsOf(path: Path, relief: Relief, rect: Rect, occluded: boolean): Run[] {
  const runs = new Runs(relief, occluded);
  const { axes } = relief.camera.frame;
  for (const part of path.draped ? drapedParts(path.points, relief, rect) : [path.points]) {
    const uvds = part.map((point) => uvdFromLocal(axes, point));
    for (let k = 1; k < uvds.length; k++) {
      const [from, to] = [uvds[k - 1] as Vec3, uvds[k] as Vec3];
      const inside = clipped(from, to, rect);
      if (inside) runs.add(from, to, inside);
    }
  }
  return runs.all;
}

/** Shares of the way between which a segment lies in a rectangle; null when it does not meet it. */
export function clipped(from: readonly number[], to: readonly number[], [low, high]: Rect): [number, number] | null {
  let [t0, t1] = [0, 1];
  for (const k of [0, 1] as const) {
    const [a, way] = [from[k] as number, (to[k] as number) - (from[k] as number)];
    if (way === 0) {
      if (a < low[k] || a > high[k]) return null;
      continue;
    }
    const [s, e] = [(low[k] - a) / way, (high[k] - a) / way];
    [t0, t1] = [Math.max(t0, Math.min(s, e)), Math.min(t1, Math.max(s, e))];
    if (t0 > t1) return null;
  }
  return [t0, t1];
}

/** Points on a straight way are left out; small, since bends of many pixels add up. */
const BEND_PX = 0.02;

class Runs {
  readonly all: Run[] = [];
  readonly #relief: Relief;
  readonly #occluded: boolean;
  #end: Vec2 | null = null;

  constructor(relief: Relief, occluded: boolean) {
    [this.#relief, this.#occluded] = [relief, occluded];
  }

  /** Goes on with a segment, between two shares of its way; tests the middle of each pixel's length. */
  add(from: Vec3, to: Vec3, [t0, t1]: readonly [number, number]): void {
    const at = (t: number): Vec3 => [from[0] + (to[0] - from[0]) * t, from[1] + (to[1] - from[1]) * t, from[2] + (to[2] - from[2]) * t];
    const long = Math.hypot(to[0] - from[0], to[1] - from[1]) * (t1 - t0);
    const steps = this.#occluded ? Math.max(1, Math.ceil(long / this.#relief.pixel_m)) : 1;
    const share = (k: number): number => t0 + ((t1 - t0) * k) / steps;
    let start = 0;
    let hidden = this.#hides(at(share(0.5)));
    for (let k = 1; k <= steps; k++) {
      const next = k < steps && this.#hides(at(share(k + 0.5)));
      if (k < steps && next === hidden) continue;
      this.#stretch(hidden, at(share(start)), at(share(k)));
      [start, hidden] = [k, next];
    }
  }

  #hides([u, v, d]: Vec3): boolean {
    return this.#occluded && this.#relief.isOccluded(u, v, d);
  }

  #stretch(hidden: boolean, from: Vec3, to: Vec3): void {
    let run = this.all.at(-1);
    const joined = this.#end && Math.hypot(this.#end[0] - from[0], this.#end[1] - from[1]) < 1e-6 + this.#relief.pixel_m / 100;
    if (!run || !joined || run.hidden !== hidden) this.all.push((run = { hidden, uv: [from[0], from[1]] }));
    append(run.uv, to[0], to[1], BEND_PX * this.#relief.pixel_m);
    this.#end = [to[0], to[1]];
  }
}

/** Adds a point; the one before goes when the way through it is straight: the new point lies on the line so far, to `bend` metres. */
function append(uv: number[], u: number, v: number, bend: number): void {
  const n = uv.length;
  if (n >= 4) {
    const [u0, v0, u1, v1] = uv.slice(n - 4) as [number, number, number, number];
    const [eu, ev, du, dv] = [u1 - u0, v1 - v0, u - u1, v - v1];
    if (eu * du + ev * dv >= 0 && Math.abs(eu * dv - ev * du) <= bend * Math.hypot(eu, ev)) uv.length = n - 2;
  }
  uv.push(u, v);
}

/** The parts of a draped line that can lie in a rectangle, with a height for each pixel's length. */
function drapedParts(points: readonly Vec3[], relief: Relief, [low, high]: Rect): Vec3[][] {
  const { axes } = relief.camera.frame;
  const [lowest, highest] = relief.heights;
  const reach: Rect = [[low[0], low[1] - highest * axes.up[2]], [high[0], high[1] - lowest * axes.up[2]]];
  const parts: Vec3[][] = [];
  let part: Vec3[] = [];
  const ended = (): void => {
    if (part.length > 1) parts.push(part);
    part = [];
  };
  for (let k = 1; k < points.length; k++) {
    const [from, to] = [points[k - 1] as Vec3, points[k] as Vec3];
    const [a, b] = [uvdFromLocal(axes, [from[0], from[1], 0]), uvdFromLocal(axes, [to[0], to[1], 0])];
    const inside = clipped(a, b, reach);
    if (!inside || inside[0] > 0) ended();
    if (!inside) continue;
    const steps = Math.max(1, Math.ceil((Math.hypot(b[0] - a[0], b[1] - a[1]) * (inside[1] - inside[0])) / relief.pixel_m));
    for (let step = part.length > 0 ? 1 : 0; step <= steps; step++) {
      const t = inside[0] + ((inside[1] - inside[0]) * step) / steps;
      part.push([from[0] + (to[0] - from[0]) * t, from[1] + (to[1] - from[1]) * t, NaN]);
    }
    if (inside[1] < 1) ended();
  }
  ended();
  return parts.filter((found) => raise(found, relief));
}

/** Gives positions the heights of the surface. @returns false when nothing is known of them */
function raise(points: Vec3[], relief: Relief): boolean {
  const heights = points.map(([x, y]) => landing(relief, x, y));
  points.forEach(([x, y], k) => (points[k] = [x, y, heights[k] ?? NaN]));
  if (!fillHeights(points)) points.forEach(([x, y], k) => (points[k] = [x, y, relief.heights[0]]));
  return heights.some((height) => height !== null);
}

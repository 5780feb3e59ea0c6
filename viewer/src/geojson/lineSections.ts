import type { Vec2, Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import type { VisibleDepths } from "../map3d";
import { fillHeights, drapedHeight } from "./drape";

/** [[least U, least V], [greatest U, greatest V]], metres. */
export type UvRect = readonly [Vec2, Vec2];

/** A polyline in local coordinates. */
export interface Path {
  readonly points: readonly Vec3[];
  /** Heights come from the visible surface. */
  readonly draped: boolean;
}

/** A section of a line that is either visible or hidden. */
export interface LineSection {
  readonly hidden: boolean;
  /** U and V, interleaved. */
  readonly uv: number[];
}

/** Splits the part of a line in a rectangle into visible and hidden sections, in order. @param occluded false treats the whole line as visible */
export function sectionsOf(path: Path, relief: VisibleDepths, rect: UvRect, occluded: boolean): LineSection[] {
  const sections = new SectionBuilder(relief, occluded);
  const { axes } = relief.camera.frame;
  for (const part of path.draped ? drapedParts(path.points, relief, rect) : [path.points]) {
    const uvds = part.map((point) => uvdFromLocal(axes, point));
    for (let k = 1; k < uvds.length; k++) {
      const [from, to] = [uvds[k - 1] as Vec3, uvds[k] as Vec3];
      const inside = clipped(from, to, rect);
      if (inside) sections.add(from, to, inside);
    }
  }
  return sections.all;
}

/** Clips a segment to a rectangle: returns its start and end as fractions of the segment, or null when they do not overlap. */
export function clipped(from: readonly number[], to: readonly number[], [low, high]: UvRect): [number, number] | null {
  let [t0, t1] = [0, 1];
  for (const k of [0, 1] as const) {
    const [a, delta] = [from[k] as number, (to[k] as number) - (from[k] as number)];
    if (delta === 0) {
      if (a < low[k] || a > high[k]) return null;
      continue;
    }
    const [s, e] = [(low[k] - a) / delta, (high[k] - a) / delta];
    [t0, t1] = [Math.max(t0, Math.min(s, e)), Math.min(t1, Math.max(s, e))];
    if (t0 > t1) return null;
  }
  return [t0, t1];
}

/** Largest deviation at which a point on a straight line is dropped. It is small, since deviations add up. */
const BEND_PX = 0.02;

class SectionBuilder {
  readonly all: LineSection[] = [];
  readonly #relief: VisibleDepths;
  readonly #occluded: boolean;
  #end: Vec2 | null = null;

  constructor(relief: VisibleDepths, occluded: boolean) {
    [this.#relief, this.#occluded] = [relief, occluded];
  }

  /** Appends a clipped segment; tests visibility once per pixel. */
  add(from: Vec3, to: Vec3, [t0, t1]: readonly [number, number]): void {
    const at = (t: number): Vec3 => [from[0] + (to[0] - from[0]) * t, from[1] + (to[1] - from[1]) * t, from[2] + (to[2] - from[2]) * t];
    const length_m = Math.hypot(to[0] - from[0], to[1] - from[1]) * (t1 - t0);
    const steps = this.#occluded ? Math.max(1, Math.ceil(length_m / this.#relief.pixel_m)) : 1;
    const fraction = (k: number): number => t0 + ((t1 - t0) * k) / steps;
    let start = 0;
    let hidden = this.#hides(at(fraction(0.5)));
    for (let k = 1; k <= steps; k++) {
      const next = k < steps && this.#hides(at(fraction(k + 0.5)));
      if (k < steps && next === hidden) continue;
      this.#append(hidden, at(fraction(start)), at(fraction(k)));
      [start, hidden] = [k, next];
    }
  }

  #hides([u, v, d]: Vec3): boolean {
    return this.#occluded && this.#relief.isOccluded(u, v, d);
  }

  #append(hidden: boolean, from: Vec3, to: Vec3): void {
    let section = this.all.at(-1);
    const joined = this.#end && Math.hypot(this.#end[0] - from[0], this.#end[1] - from[1]) < 1e-6 + this.#relief.pixel_m / 100;
    if (!section || !joined || section.hidden !== hidden) this.all.push((section = { hidden, uv: [from[0], from[1]] }));
    append(section.uv, to[0], to[1], BEND_PX * this.#relief.pixel_m);
    this.#end = [to[0], to[1]];
  }
}

/** Appends a point and drops the previous one when the three are collinear within `bend` metres. */
function append(uv: number[], u: number, v: number, bend: number): void {
  const n = uv.length;
  if (n >= 4) {
    const [u0, v0, u1, v1] = uv.slice(n - 4) as [number, number, number, number];
    const [eu, ev, du, dv] = [u1 - u0, v1 - v0, u - u1, v - v1];
    if (eu * du + ev * dv >= 0 && Math.abs(eu * dv - ev * du) <= bend * Math.hypot(eu, ev)) uv.length = n - 2;
  }
  uv.push(u, v);
}

/** Returns the parts of a draped line that can be in a rectangle, sampled once per pixel, with heights. */
function drapedParts(points: readonly Vec3[], relief: VisibleDepths, [low, high]: UvRect): Vec3[][] {
  const { axes } = relief.camera.frame;
  const [lowest, highest] = relief.heights;
  const reach: UvRect = [
    [low[0], low[1] - highest * axes.up[2]],
    [high[0], high[1] - lowest * axes.up[2]],
  ];
  const parts: Vec3[][] = [];
  let part: Vec3[] = [];
  const endPart = (): void => {
    if (part.length > 1) parts.push(part);
    part = [];
  };
  for (let k = 1; k < points.length; k++) {
    const [from, to] = [points[k - 1] as Vec3, points[k] as Vec3];
    const [a, b] = [uvdFromLocal(axes, [from[0], from[1], 0]), uvdFromLocal(axes, [to[0], to[1], 0])];
    const inside = clipped(a, b, reach);
    if (!inside || inside[0] > 0) endPart();
    if (!inside) continue;
    const steps = Math.max(1, Math.ceil((Math.hypot(b[0] - a[0], b[1] - a[1]) * (inside[1] - inside[0])) / relief.pixel_m));
    for (let step = part.length > 0 ? 1 : 0; step <= steps; step++) {
      const t = inside[0] + ((inside[1] - inside[0]) * step) / steps;
      part.push([from[0] + (to[0] - from[0]) * t, from[1] + (to[1] - from[1]) * t, NaN]);
    }
    if (inside[1] < 1) endPart();
  }
  endPart();
  return parts.filter((points) => setHeights(points, relief));
}

/** Sets the heights of positions from the surface. @returns false when none is known */
function setHeights(points: Vec3[], relief: VisibleDepths): boolean {
  const heights = points.map(([x, y]) => drapedHeight(relief, x, y));
  points.forEach(([x, y], k) => (points[k] = [x, y, heights[k] ?? NaN]));
  if (!fillHeights(points)) points.forEach(([x, y], k) => (points[k] = [x, y, relief.heights[0]]));
  return heights.some((height) => height !== null);
}

import type { Vec2, Vec3 } from "../core/vec";
import { pixelM, type Frame, type Tile } from "../geo/frame";

/** How a pass takes part in a picture that several make by depth. U, V and D are those of the map: of its first layer's origin. Metres. */
export interface DepthMapping {
  /** Of the pass's own rendering. */
  readonly frame: Frame;
  /** U, V and D of its origin. */
  readonly shift: Vec3;
  /** Of its depth values. */
  readonly unit_m: number;
  /** How much nearer than measured it counts, so that of two layers with one surface the later is seen. */
  readonly bias_m: number;
  /** Least and greatest D. */
  readonly range: Vec2;
}

/** How near a later layer may be behind an earlier one to be seen: so many of its pixels for each layer that comes before it. */
const BIAS_PX = 1;

export const computeBias = (frame: Frame, level: number, before: number): number => BIAS_PX * before * pixelM(frame, level);

/** Metres that level ground recedes for each metre that it rises on the screen; walls come nearer by the inverse. */
const computeRecession = ({ axes: { up, forward } }: Frame): number => up[2] / Math.max(-forward[2], 0.05);

/** By how many depth values of a level neighbouring pixels differ at most, if they are of one surface: once and a half what ground or walls do. */
export function computeMaxStep({ frame, unit_m }: DepthMapping, level: number): number {
  const ground = computeRecession(frame);
  return Math.ceil((1.5 * Math.max(ground, 1 / Math.max(ground, 0.1)) * pixelM(frame, level)) / unit_m);
}

/** What lies on a surface is seen, if it lies not deeper in it than this. */
const MIN_BIAS_M = 0.05;

/** How much nearer guests count than they are: pixels above the deepest level have the nearest depth below them, on level ground up to half a pixel's before the middle. */
export const computeCustomLayerBias = (frame: Frame, level: number): number => MIN_BIAS_M + 0.5 * (1 - 2 ** (level - frame.zmax)) * pixelM(frame, level) * computeRecession(frame);

/** D of a depth value is `first + value · unit_m`, for comparisons. */
export const computeDepthAtZero = ({ frame, shift, bias_m }: DepthMapping): number => frame.d0 + shift[2] - bias_m;

/** Least and greatest D of passes and of what else is there, with a little room; null without any. */
export function joinDepthRanges(all: readonly DepthMapping[], others: readonly Vec2[] = []): Vec2 | null {
  const ranges = [...others, ...all.map(({ range, bias_m }): Vec2 => [range[0] - bias_m, range[1]])];
  if (ranges.length === 0) return null;
  const [near, far] = [Math.min(...ranges.map(([least]) => least)), Math.max(...ranges.map(([, most]) => most))];
  const room = 0.01 * (far - near) + 1;
  return [near - room, far + room];
}

/** U and V of a tile's left top corner on the map, and metres a pixel. */
export function computeCorner({ frame, shift }: DepthMapping, { z, x, y }: Tile): readonly [u: number, v: number, px_m: number] {
  const px = pixelM(frame, z);
  return [frame.u0 + shift[0] + x * frame.tilePx * px, frame.v0 + shift[1] - y * frame.tilePx * px, px];
}

/** Two clips (left, top, right, bottom in shares of the map; null: all of it) that have a point in common. */
export function overlaps(a: Clip | null, b: Clip | null): boolean {
  return !a || !b || (a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]);
}

/** A part of the map, in shares of its width and height. */
export type Clip = readonly [left: number, top: number, right: number, bottom: number];

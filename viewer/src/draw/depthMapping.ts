import type { Vec2, Vec3 } from "../core/vec";
import { pixelM, type Frame, type Tile } from "../geo/frame";

/** Maps a pass's depth values to the map's D. U, V and D refer to the origin of the map's first layer. Metres. */
export interface DepthMapping {
  /** The frame of the pass's own rendering. */
  readonly frame: Frame;
  /** U, V and D of the rendering's origin. */
  readonly shift: Vec3;
  /** Unit of its depth values. */
  readonly unit_m: number;
  /** Depth bias towards the viewer, so that the later of two layers with the same surface is visible. */
  readonly bias_m: number;
  /** Minimum and maximum D. */
  readonly range: Vec2;
}

/** Depth bias of a layer in its pixels, for each layer before it. */
const BIAS_PX = 1;

export const computeBias = (frame: Frame, level: number, before: number): number => BIAS_PX * before * pixelM(frame, level);

/** Computes by how many metres level ground recedes per metre up the screen; walls come nearer by the inverse. */
const computeRecession = ({ axes: { up, forward } }: Frame): number => up[2] / Math.max(-forward[2], 0.05);

/** Computes the largest difference, in depth values, between neighbouring pixels of one surface: 1.5 times that of ground or walls. */
export function computeMaxStep({ frame, unit_m }: DepthMapping, level: number): number {
  const ground = computeRecession(frame);
  return Math.ceil((1.5 * Math.max(ground, 1 / Math.max(ground, 0.1)) * pixelM(frame, level)) / unit_m);
}

/** Custom layers are visible up to this far below a surface. */
const MIN_BIAS_M = 0.05;

/** Computes the depth bias of custom layers: a pixel above the deepest level has the minimum depth of those below it, on level ground up to half a pixel nearer than its centre. */
export const computeCustomLayerBias = (frame: Frame, level: number): number =>
  MIN_BIAS_M + 0.5 * (1 - 2 ** (level - frame.zmax)) * pixelM(frame, level) * computeRecession(frame);

/** Computes D of depth value 0, including the bias: D = first + value · unit_m. */
export const computeDepthAtZero = ({ frame, shift, bias_m }: DepthMapping): number => frame.d0 + shift[2] - bias_m;

/** Joins the ranges of D of passes and other content, with a small margin; null without any. */
export function joinDepthRanges(all: readonly DepthMapping[], others: readonly Vec2[] = []): Vec2 | null {
  const ranges = [...others, ...all.map(({ range, bias_m }): Vec2 => [range[0] - bias_m, range[1]])];
  if (ranges.length === 0) return null;
  const [near, far] = [Math.min(...ranges.map(([least]) => least)), Math.max(...ranges.map(([, most]) => most))];
  const margin = 0.01 * (far - near) + 1;
  return [near - margin, far + margin];
}

/** Computes U and V of a tile's top left corner on the map, and its metres per pixel. */
export function computeCorner({ frame, shift }: DepthMapping, { z, x, y }: Tile): readonly [u: number, v: number, px_m: number] {
  const px = pixelM(frame, z);
  return [frame.u0 + shift[0] + x * frame.tilePx * px, frame.v0 + shift[1] - y * frame.tilePx * px, px];
}

/** Whether two clips overlap; null: the whole map. */
export function overlaps(a: Clip | null, b: Clip | null): boolean {
  return !a || !b || (a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]);
}

/** A part of the map, in fractions of its width and height. */
export type Clip = readonly [left: number, top: number, right: number, bottom: number];

import type { Vec2 } from "../core/vec";
import { computeAxes, type Axes } from "./axes";

/** A tile's address in its pyramid: spec/pyramid.md §3. */
export interface Tile {
  readonly z: number;
  readonly x: number;
  readonly y: number;
}

/** The pinned square of a view, which its tiles divide. Metres, local frame of the rendering. */
export interface Frame {
  readonly id: string;
  readonly lookAt_deg: number;
  readonly pitch_deg: number;
  readonly axes: Axes;
  readonly u0: number;
  readonly v0: number;
  readonly d0: number;
  /** Side length of the square. */
  readonly size: number;
  readonly tilePx: number;
  readonly zmax: number;
}

export interface FrameJson {
  id: string;
  look_at_deg: number;
  pitch_deg: number;
  u0_m: number;
  v0_m: number;
  d0_m: number;
}

export function makeFrame(view: FrameJson, size: number, tilePx: number, zmax: number): Frame {
  const axes = computeAxes(view.look_at_deg, view.pitch_deg);
  const { id, look_at_deg: lookAt_deg, pitch_deg: pitch_deg, u0_m: u0, v0_m: v0, d0_m: d0 } = view;
  return { id, lookAt_deg, pitch_deg, axes, u0, v0, d0, size, tilePx, zmax };
}

/** Metres per pixel at level z (which may be fractional). */
export const pixelM = (frame: Frame, z: number): number => frame.size / (frame.tilePx * 2 ** z);

/** Returns U and V of the centre of a tile's pixel (i, j). */
export function uvOfPixel(frame: Frame, tile: Tile, i: number, j: number): Vec2 {
  const px = pixelM(frame, tile.z);
  return [frame.u0 + (tile.x * frame.tilePx + i + 0.5) * px, frame.v0 - (tile.y * frame.tilePx + j + 0.5) * px];
}

/** Finds the tile of level z, and its pixel, at (U, V); null outside the square. */
export function pixelAt(frame: Frame, z: number, u: number, v: number): { tile: Tile; i: number; j: number } | null {
  const px = pixelM(frame, z);
  const [column, row, side] = [Math.floor((u - frame.u0) / px), Math.floor((frame.v0 - v) / px), frame.tilePx * 2 ** z];
  if (!(column >= 0 && row >= 0 && column < side && row < side)) return null;
  const [x, y] = [Math.floor(column / frame.tilePx), Math.floor(row / frame.tilePx)];
  return { tile: { z, x, y }, i: column - x * frame.tilePx, j: row - y * frame.tilePx };
}

/** Returns a tile's ancestor `up` levels above. */
export const ancestor = ({ z, x, y }: Tile, up: number): Tile => ({ z: z - up, x: Math.floor(x / 2 ** up), y: Math.floor(y / 2 ** up) });

/** Returns a tile's children in the order TL, TR, BL, BR. */
export function childrenOf({ z, x, y }: Tile): [Tile, Tile, Tile, Tile] {
  const [x2, y2] = [2 * x, 2 * y];
  return [
    { z: z + 1, x: x2, y: y2 },
    { z: z + 1, x: x2 + 1, y: y2 },
    { z: z + 1, x: x2, y: y2 + 1 },
    { z: z + 1, x: x2 + 1, y: y2 + 1 },
  ];
}

/** The deepest level that a pyramid may have (spec/limits.json). */
export const DEEPEST_LEVEL = 26;

/** Interleaves the bits of x and y, x in the even bits; exact up to the deepest level. */
export function morton(x: number, y: number): number {
  let code = 0;
  for (let bit = 0, place = 1; bit < DEEPEST_LEVEL; bit++, place *= 4) code += place * (((x >> bit) & 1) + 2 * ((y >> bit) & 1));
  return code;
}

/** Returns the root level of the blocks that hold level z. spec/pyramid.md §8. */
export function blockLevel(z: number, zmax: number): number {
  let root = Math.max(zmax - 3, 0);
  while (z < root) root = Math.max(root - 3, 0);
  return root;
}

/** Returns the root tile of a tile's block. */
export const blockRoot = (tile: Tile, zmax: number): Tile => ancestor(tile, tile.z - blockLevel(tile.z, zmax));

export const tileName = ({ z, x, y }: Tile): string => `${String(z)}/${String(x)}/${String(y)}`;

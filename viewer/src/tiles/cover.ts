import type { Vec2 } from "../core/vec";
import { clamp } from "../core/vec";
import type { Camera } from "../geo/camera";
import { ancestor, childrenOf, type Frame, type Tile } from "../geo/frame";

/** [[min U, min V], [max U, max V]], metres. */
export type Rect = readonly [Vec2, Vec2];

/** Computes the rectangle that a screen centred on U and V shows, at `px` metres per CSS pixel. */
export function computeViewRect(u: number, v: number, { width, height }: Pick<Camera, "width" | "height">, px: number): Rect {
  const [w, h] = [(width / 2) * px, (height / 2) * px];
  return [
    [u - w, v - h],
    [u + w, v + h],
  ];
}

/** From this many device pixels per CSS pixel on, a screen counts as dense. */
export const DENSE_DPR = 1.5;

/**
 * Computes the level to show when a device pixel is `devicePx_m` metres wide. On dense screens a tile pixel covers one to two
 * device pixels, which is not visible there and saves bytes; on others 0.7 to 1.4. `finer`: additional levels.
 */
export function computeLevel(frame: Frame, devicePx_m: number, dpr: number, finer = 0): number {
  const exact = Math.log2(frame.size / (frame.tilePx * devicePx_m)) + finer;
  return clamp(Math.floor(exact + (dpr >= DENSE_DPR ? 0.001 : 0.5)), 0, frame.zmax);
}

/** Finds the occupied tiles of a level that intersect a rectangle, row by row. */
export function findCover(frame: Frame, occupied: (tile: Tile) => boolean, level: number, [low, high]: Rect): Tile[] {
  const tile_m = frame.size / 2 ** level;
  const last = 2 ** level - 1;
  const [x0, x1] = [Math.floor((low[0] - frame.u0) / tile_m), Math.ceil((high[0] - frame.u0) / tile_m) - 1];
  const [y0, y1] = [Math.floor((frame.v0 - high[1]) / tile_m), Math.ceil((frame.v0 - low[1]) / tile_m) - 1];
  const tiles: Tile[] = [];
  for (let y = Math.max(y0, 0); y <= Math.min(y1, last); y++) {
    for (let x = Math.max(x0, 0); x <= Math.min(x1, last); x++) {
      const tile = { z: level, x, y };
      if (occupied(tile)) tiles.push(tile);
    }
  }
  return tiles;
}

/** Sorts tiles by their distance from the rectangle's centre. */
export function sortFromCenter(frame: Frame, tiles: readonly Tile[], [low, high]: Rect): Tile[] {
  const [u, v] = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  const distance = ({ z, x, y }: Tile): number => {
    const tile_m = frame.size / 2 ** z;
    return Math.hypot(frame.u0 + (x + 0.5) * tile_m - u, frame.v0 - (y + 0.5) * tile_m - v);
  };
  return [...tiles].sort((a, b) => distance(a) - distance(b));
}

/** A tile whose pixels fill an area: the tile itself, an ancestor, or a descendant that covers the area. */
export interface TileFallback {
  /** The area to draw. */
  readonly area: Tile;
  /** The tile whose pixels are drawn there. */
  readonly from: Tile;
}

/**
 * Finds the tiles to draw for one tile of the cover: itself if ready, else ready descendants, else the nearest ready ancestor. The
 * areas are disjoint and within the tile, so that nothing is blended twice.
 */
export function findFallbacks(tile: Tile, ready: (tile: Tile) => boolean, occupied: (tile: Tile) => boolean, down = 2): TileFallback[] {
  if (ready(tile)) return [{ area: tile, from: tile }];
  if (down > 0 && hasReadyBelow(tile, ready, occupied, down)) {
    return childrenOf(tile)
      .filter(occupied)
      .flatMap((child) => findFallbacks(child, ready, occupied, down - 1));
  }
  for (let up = 1; up <= tile.z; up++) {
    const from = ancestor(tile, up);
    if (ready(from)) return [{ area: tile, from }];
  }
  return [];
}

function hasReadyBelow(tile: Tile, ready: (tile: Tile) => boolean, occupied: (tile: Tile) => boolean, down: number): boolean {
  const children = childrenOf(tile).filter(occupied);
  return children.some((child) => ready(child) || (down > 1 && hasReadyBelow(child, ready, occupied, down - 1)));
}

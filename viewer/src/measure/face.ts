import { add, clamp, sub, type Vec2, type Vec3 } from "../core/vec";
import { localFromUvd, uvdFromLocal } from "../geo/axes";
import type { Frame } from "../geo/frame";
import type { map } from "../map3d";
import { Growing, type Region, type Sides } from "./region";

/** The flat piece of one object's surface around a place, as far as it is seen. */
export interface Face {
  /** Of what is seen of it. */
  readonly area_m2: number;
  /** Against the horizontal: 0 a floor, 90 a wall. */
  readonly slope_deg: number;
  /** Unit, towards the viewer. */
  readonly normal: Vec3;
  /** Closed loops of world points, the last joins the first; those of holes go round the other way. */
  readonly outline: readonly (readonly Vec3[])[];
  /** Something nearer stands before a part of it: the area is at least so large. */
  readonly hidden: boolean;
  /** Read above the deepest level, or from what was in memory when tiles could not be had. */
  readonly approximate: boolean;
}

/** Until when a face is looked for. */
export interface FaceOptions {
  signal?: AbortSignal;
}

/** Tiles that a face may take, of 256 × 256 pixels. */
const TILES = 36;
/** Share of the border from which on a face counts as partly hidden. */
const HIDDEN = 0.05;
/** A place is on the surface that is seen when it lies no farther from it: pixels and metres of D. */
const [OFF_PX, OFF_M] = [8, 0.5];

/**
 * The face around a place of the surface (world), in the view that the map shows: pixels of the same object that lie in one plane. Tiles are fetched as
 * it grows. null where the place is hidden, or nothing flat is there. @throws the signal's reason
 */
export async function measureFace(map: map, position: Vec3, { signal }: FaceOptions = {}): Promise<Face | null> {
  const sight = map.getViewState();
  if (!sight) return null;
  const { axes, u0, v0, size, zmax, tilePx } = sight.camera.frame;
  const [u, v, d] = uvdFromLocal(axes, sub(position, sight.origin));
  const last = 2 ** zmax;
  const tile_m = size / last;
  const [x, y] = [Math.floor((u - u0) / tile_m), Math.floor((v0 - v) / tile_m)];
  for (let tiles: Sides = [x, y, x + 1, y + 1]; ;) {
    const { relief, approximate } = await map.fetchRelief(sight, rectOf(tiles, u0, v0, tile_m), Math.max(TILES * (256 / tilePx) ** 2, 4), true);
    signal?.throwIfAborted();
    const px = relief.pixel_m;
    if (!(Math.abs(relief.depthAt(u, v) - d) <= OFF_PX * px + OFF_M)) return null;
    const sides = tiles.map((tile, k) => (k < 2 ? Math.floor : Math.ceil)((tile * tile_m) / px)) as unknown as Sides;
    const open = tiles.reduce((bits, tile, k) => bits | (tile === (k < 2 ? 0 : last) ? 0 : 1 << k), 0);
    const region = new Growing(relief, { u0, v0, sides, open }, Math.floor((u - u0) / px), Math.floor((v0 - v) / px)).grown();
    if (typeof region !== "number") return region && faceOf(region, sight.camera.frame, px, sight.origin, approximate);
    tiles = widened(tiles, region, last);
  }
}

/** U and V; a little less, so that tiles beside it are none of it. */
function rectOf([left, top, right, bottom]: Sides, u0: number, v0: number, tile_m: number): readonly [low: Vec2, high: Vec2] {
  const inset = 1e-6;
  return [[u0 + (left + inset) * tile_m, v0 - (bottom - inset) * tile_m], [u0 + (right - inset) * tile_m, v0 - (top + inset) * tile_m]];
}

/** By its own size at each side that is touched (bits). */
function widened(tiles: Sides, touched: number, last: number): Sides {
  const [left, top, right, bottom] = tiles;
  const by = [left - right, top - bottom, right - left, bottom - top];
  return tiles.map((tile, k) => clamp(tile + (touched & (1 << k) ? (by[k] as number) : 0), 0, last)) as unknown as Sides;
}

/** @param origin world, of the frame's local coordinates */
function faceOf({ plane, pixels, hidden, loops }: Region, { axes, u0, v0 }: Frame, px: number, origin: Vec3, approximate: boolean): Face {
  const [x, y] = [plane.x / px, plane.y / px];
  const stretch = Math.hypot(1, x, y);
  const normal = localFromUvd(axes, [x / stretch, -y / stretch, -1 / stretch]);
  return {
    area_m2: pixels * px * px * stretch,
    slope_deg: (Math.acos(Math.min(Math.abs(normal[2]), 1)) * 180) / Math.PI,
    normal,
    outline: loops.map((loop) => loop.map(([column, row, depth]) => add(origin, localFromUvd(axes, [u0 + column * px, v0 - row * px, depth])))),
    hidden: hidden > HIDDEN,
    approximate,
  };
}

import { add, clamp, sub, type Vec2, type Vec3 } from "../core/vec";
import { localFromUvd, uvdFromLocal } from "../geo/axes";
import type { Frame } from "../geo/frame";
import type { Map3D } from "../map3d";
import { RegionGrower, type PlanarRegion, type GridBounds } from "./regionGrower";

/** A flat face of one object, as far as it is visible. */
export interface Face {
  /** Area of the visible part. */
  readonly area_m2: number;
  /** Angle to the horizontal: 0 for a floor, 90 for a wall. */
  readonly slope_deg: number;
  /** Unit vector towards the viewer. */
  readonly normal: Vec3;
  /** Closed loops of world points, without the repeated first point; holes run in the opposite direction. */
  readonly outline: readonly (readonly Vec3[])[];
  /** Something nearer hides a part of the face, so the area is a lower bound. */
  readonly hidden: boolean;
  /** Read above the deepest level, or only from tiles in memory. */
  readonly approximate: boolean;
}

/** Options of `measureFace`. */
export interface FaceOptions {
  /** Aborts the measurement. Default: none. */
  signal?: AbortSignal;
}

/** Maximum number of tiles of 256 × 256 pixels that a face may need. */
const MAX_TILES = 36;
/** A face counts as partly hidden when more than this fraction of its border is. */
const HIDDEN_FRACTION = 0.05;
/** Largest distance of the position from the visible surface: pixels and metres of D. */
const [TOLERANCE_PX, TOLERANCE_M] = [8, 0.5];

/**
 * Measures the face at a position on the surface (world), in the current view: the pixels of one object that are in one plane. Fetches tiles as the face
 * grows. Returns null where the position is hidden or the surface is not flat. @throws the signal's reason
 */
export async function measureFace(map: Map3D, position: Vec3, { signal }: FaceOptions = {}): Promise<Face | null> {
  const state = map.getViewState();
  if (!state) return null;
  const { axes, u0, v0, size, zmax, tilePx } = state.camera.frame;
  const [u, v, d] = uvdFromLocal(axes, sub(position, state.origin));
  const last = 2 ** zmax;
  const tile_m = size / last;
  const [x, y] = [Math.floor((u - u0) / tile_m), Math.floor((v0 - v) / tile_m)];
  for (let tiles: GridBounds = [x, y, x + 1, y + 1]; ;) {
    const { relief, approximate } = await map.fetchDepths(
      state,
      rectOf(tiles, u0, v0, tile_m),
      Math.max(MAX_TILES * (256 / tilePx) ** 2, 4),
      true,
    );
    signal?.throwIfAborted();
    const px = relief.pixel_m;
    if (!(Math.abs(relief.depthAt(u, v) - d) <= TOLERANCE_PX * px + TOLERANCE_M)) return null;
    const bounds = tiles.map((tile, k) => (k < 2 ? Math.floor : Math.ceil)((tile * tile_m) / px)) as unknown as GridBounds;
    const open = tiles.reduce((bits, tile, k) => bits | (tile === (k < 2 ? 0 : last) ? 0 : 1 << k), 0);
    const region = new RegionGrower(relief, { u0, v0, bounds, open }, Math.floor((u - u0) / px), Math.floor((v0 - v) / px)).grow();
    if (typeof region !== "number") return region && faceOf(region, state.camera.frame, px, state.origin, approximate);
    tiles = widen(tiles, region, last);
  }
}

/** Rectangle of tiles in U and V, inset slightly so that it does not touch the neighbouring tiles. */
function rectOf([left, top, right, bottom]: GridBounds, u0: number, v0: number, tile_m: number): readonly [low: Vec2, high: Vec2] {
  const inset = 1e-6;
  return [
    [u0 + (left + inset) * tile_m, v0 - (bottom - inset) * tile_m],
    [u0 + (right - inset) * tile_m, v0 - (top + inset) * tile_m],
  ];
}

/** Doubles the bounds at each side that the region touches (bits). */
function widen(tiles: GridBounds, touched: number, last: number): GridBounds {
  const [left, top, right, bottom] = tiles;
  const by = [left - right, top - bottom, right - left, bottom - top];
  return tiles.map((tile, k) => clamp(tile + (touched & (1 << k) ? (by[k] as number) : 0), 0, last)) as unknown as GridBounds;
}

/** Computes the face of a region. @param origin world coordinates of the local origin */
function faceOf(
  { plane, pixels, hidden, loops }: PlanarRegion,
  { axes, u0, v0 }: Frame,
  px: number,
  origin: Vec3,
  approximate: boolean,
): Face {
  const [x, y] = [plane.x / px, plane.y / px];
  const stretch = Math.hypot(1, x, y);
  const normal = localFromUvd(axes, [x / stretch, -y / stretch, -1 / stretch]);
  return {
    area_m2: pixels * px * px * stretch,
    slope_deg: (Math.acos(Math.min(Math.abs(normal[2]), 1)) * 180) / Math.PI,
    normal,
    outline: loops.map((loop) =>
      loop.map(([column, row, depth]) => add(origin, localFromUvd(axes, [u0 + column * px, v0 - row * px, depth]))),
    ),
    hidden: hidden > HIDDEN_FRACTION,
    approximate,
  };
}

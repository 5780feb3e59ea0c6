import { add, dot, sub, type Vec2, type Vec3 } from "../core/vec";
import { computeBias } from "../draw/depthMapping";
import { localFromUvd } from "../geo/axes";
import { cssPixelM } from "../geo/camera";
import { pixelAt, uvOfPixel, type Tile } from "../geo/frame";
import type { View } from "../geo/manifest";
import { type LayerKind, NO_DEPTH, type TileData } from "../tiles/tileData";
import { groupByDepth } from "./depthGroups";
import type { ImageLayer } from "./imageLayer";
import { DEPTH_UNIT_M, computeCenter } from "./layerPlan";
import type { ViewState } from "./layerContext";

/** The object under a point. */
export interface Pick {
  /** Object id; 0: none. */
  readonly id: number;
  /** World coordinates of the surface; null where there is none, or its depth is unknown. */
  readonly position: Vec3 | null;
  /** true: read from a tile above the deepest level, and therefore inexact. */
  readonly approximate: boolean;
  readonly layer: ImageLayer | null;
}

export const EMPTY_PICK: Pick = { id: 0, position: null, approximate: false, layer: null };

/** Picks the object under CSS pixels, exactly; approximate where a tile cannot be fetched. */
export async function pick(layers: readonly ImageLayer[], viewState: ViewState, at: Vec2): Promise<Pick> {
  try {
    return await pickExactly(layers, viewState, at);
  } catch {
    // The tile's error was reported when it failed.
    return { ...(pickLoaded(layers, viewState, at) ?? EMPTY_PICK), approximate: true };
  }
}

/** Picks exactly, from the deepest level; fetches its tiles if necessary. */
async function pickExactly(layers: readonly ImageLayer[], viewState: ViewState, at: Vec2): Promise<Pick> {
  for (const group of groupsAt(layers, viewState, at)) {
    const picks = await Promise.all(group.map((layer) => pickFromLayer(layer, viewState, at)));
    const pick = findNearest(picks, group, viewState);
    if (pick) return pick;
  }
  return EMPTY_PICK;
}

async function pickFromLayer(layer: ImageLayer, viewState: ViewState, at: Vec2): Promise<Pick | null> {
  const viewPoint = findViewPoint(layer, viewState, at);
  const pixel = viewPoint && pixelAt(viewPoint.view.frame, viewPoint.view.frame.zmax, ...viewPoint.uv);
  if (!pixel) return null;
  const [ids, depths] = await Promise.all([
    fetchTile(layer, viewPoint.view, "id", pixel.tile),
    fetchTile(layer, viewPoint.view, "depth", pixel.tile),
  ]);
  return readPick(layer, viewPoint.view, pixel, ids, depths);
}

/** Picks from the tiles in memory, finest first; null when none covers the point. */
export function pickLoaded(layers: readonly ImageLayer[], viewState: ViewState, at: Vec2): Pick | null {
  let nothing: Pick | null = null;
  for (const group of groupsAt(layers, viewState, at)) {
    const picks = group.map((layer) => pickLoadedFromLayer(layer, viewState, at));
    const pick = findNearest(
      picks.map((found) => (found?.layer ? found : null)),
      group,
      viewState,
    );
    if (pick) return pick;
    nothing ??= picks.find((found) => found !== null) ?? null;
  }
  return nothing;
}

/** Picks from a layer's finest tile in memory; a pick without a layer: nothing is there. */
function pickLoadedFromLayer(layer: ImageLayer, viewState: ViewState, at: Vec2): Pick | null {
  const viewPoint = findViewPoint(layer, viewState, at);
  if (!viewPoint) return null;
  const { frame } = viewPoint.view;
  for (let z = frame.zmax; z >= 0; z--) {
    const pixel = pixelAt(frame, z, ...viewPoint.uv);
    if (!pixel) return null;
    const ids = findLoadedTile(layer, viewPoint.view, "id", pixel.tile);
    if (ids)
      return (
        readPick(layer, viewPoint.view, pixel, ids, findLoadedTile(layer, viewPoint.view, "depth", pixel.tile)) ?? {
          ...EMPTY_PICK,
          approximate: z < frame.zmax,
        }
      );
  }
  return null;
}

/** Groups the layers that are visible at a point, topmost first; the layers of a group hide each other by depth. */
function groupsAt(layers: readonly ImageLayer[], { camera }: ViewState, [x, y]: Vec2): (readonly ImageLayer[])[] {
  const point: Vec2 = [x / camera.width, y / camera.height];
  return [...groupByDepth(layers.filter((layer) => layer.showsAt(point)))].reverse();
}

/** Finds the pick of a group that the drawers show. */
function findNearest(
  picks: readonly (Pick | null)[],
  group: readonly ImageLayer[],
  { camera: { frame, zoom }, origin }: ViewState,
): Pick | null {
  const depth = (pick: Pick, k: number): number =>
    pick.position ? dot(frame.axes.forward, sub(pick.position, origin)) - computeBias(frame, zoom, k) : Infinity;
  const found = picks.flatMap((pick, k) => (pick ? [{ pick, depth: group.length > 1 ? depth(pick, k) : 0 }] : []));
  return found.reduce<(typeof found)[0] | null>((best, one) => (best && best.depth < one.depth ? best : one), null)?.pick ?? null;
}

interface ViewPoint {
  readonly view: View;
  readonly uv: Vec2;
}

function findViewPoint(layer: ImageLayer, viewState: ViewState, [x, y]: Vec2): ViewPoint | null {
  const { camera } = viewState;
  const view = layer.findView(camera.frame);
  if (!view || !layer.rendering) return null;
  const [u, v] = computeCenter(view.frame, viewState, layer.rendering);
  const px = cssPixelM(camera);
  return { view, uv: [u + (x - camera.width / 2) * px, v - (y - camera.height / 2) * px] };
}

async function fetchTile(layer: ImageLayer, view: View, kind: LayerKind, tile: Tile): Promise<TileData | null> {
  const info = layer.rendering?.layers.get(kind);
  return info && layer.tiles ? layer.tiles.fetch(view, info, tile) : null;
}

function findLoadedTile(layer: ImageLayer, view: View, kind: LayerKind, tile: Tile): TileData | null {
  const info = layer.rendering?.layers.get(kind);
  return (info && layer.tiles?.get(view, info, tile)?.data) ?? null;
}

interface TilePixel {
  tile: Tile;
  i: number;
  j: number;
}

/** Reads a pick from tile data; null when nothing is there. */
function readPick(layer: ImageLayer, view: View, pixel: TilePixel, ids: TileData | null, depths: TileData | null): Pick | null {
  const id = readValue(ids, pixel);
  const depth = readValue(depths, pixel) ?? NO_DEPTH;
  if ((!id && depth === NO_DEPTH) || layer.isHidden(id ?? 0)) return null;
  return { id: id ?? 0, position: computePosition(layer, view, pixel, depth), approximate: pixel.tile.z < view.frame.zmax, layer };
}

function readValue(data: TileData | null, { i, j }: TilePixel): number | undefined {
  return data?.kind === "id" || data?.kind === "depth" ? data.values[j * data.width + i] : undefined;
}

/** Computes the world coordinates of a pixel's centre. */
function computePosition(layer: ImageLayer, { frame }: View, { tile, i, j }: TilePixel, depth: number): Vec3 | null {
  const rendering = layer.rendering;
  if (!rendering || depth === NO_DEPTH) return null;
  const unit = rendering.layers.get("depth")?.unit_m ?? DEPTH_UNIT_M;
  const [u, v] = uvOfPixel(frame, tile, i, j);
  return add(rendering.json.origin, localFromUvd(frame.axes, [u, v, frame.d0 + depth * unit]));
}

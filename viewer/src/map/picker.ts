import { add, dot, sub, type Vec2, type Vec3 } from "../core/vec";
import { computeBias } from "../draw/depthMapping";
import { localFromUvd } from "../geo/axes";
import { cssPixelM } from "../geo/camera";
import { pixelAt, uvOfPixel, type Tile } from "../geo/frame";
import type { LayerKind, View } from "../geo/manifest";
import { NO_DEPTH, type TileData } from "../tiles/tileData";
import { groupByDepth } from "./depthGroups";
import type { imageLayer } from "./imageLayer";
import { DEPTH_UNIT_M, computeCenter } from "./layerPlan";
import type { ViewState } from "./layerContext";

/** What lies under a pixel. */
export interface Pick {
  /** Object id; 0: nothing is there. */
  readonly id: number;
  /** World coordinates of the surface; null where nothing is, or its depth is not known (yet). */
  readonly position: Vec3 | null;
  /** true: read from a tile above the deepest level, so only about right. */
  readonly approximate: boolean;
  readonly layer: imageLayer | null;
}

export const EMPTY_PICK: Pick = { id: 0, position: null, approximate: false, layer: null };

/** What is exact: from the deepest level, whose tiles are fetched when they are not here. */
export async function pickExactly(layers: readonly imageLayer[], sight: ViewState, at: Vec2): Promise<Pick> {
  for (const group of groupsAt(layers, sight, at)) {
    const picks = await Promise.all(group.map((layer) => pickFromLayer(layer, sight, at)));
    const pick = findNearest(picks, group, sight);
    if (pick) return pick;
  }
  return EMPTY_PICK;
}

async function pickFromLayer(layer: imageLayer, sight: ViewState, at: Vec2): Promise<Pick | null> {
  const spot = findViewPoint(layer, sight, at);
  const pixel = spot && pixelAt(spot.view.frame, spot.view.frame.zmax, ...spot.uv);
  if (!pixel) return null;
  const [ids, depths] = await Promise.all([fetchTile(layer, spot.view, "id", pixel.tile), fetchTile(layer, spot.view, "depth", pixel.tile)]);
  return readPick(layer, spot.view, pixel, ids, depths);
}

/** What the tiles in memory tell, finest first; null when they tell nothing. */
export function pickLoaded(layers: readonly imageLayer[], sight: ViewState, at: Vec2): Pick | null {
  let nothing: Pick | null = null;
  for (const group of groupsAt(layers, sight, at)) {
    const picks = group.map((layer) => pickLoadedFromLayer(layer, sight, at));
    const pick = findNearest(picks.map((found) => (found?.layer ? found : null)), group, sight);
    if (pick) return pick;
    nothing ??= picks.find((found) => found !== null) ?? null;
  }
  return nothing;
}

/** Of the finest tile in memory; without a layer: nothing is there. */
function pickLoadedFromLayer(layer: imageLayer, sight: ViewState, at: Vec2): Pick | null {
  const spot = findViewPoint(layer, sight, at);
  if (!spot) return null;
  const { frame } = spot.view;
  for (let z = frame.zmax; z >= 0; z--) {
    const pixel = pixelAt(frame, z, ...spot.uv);
    if (!pixel) return null;
    const ids = findLoadedTile(layer, spot.view, "id", pixel.tile);
    if (ids) return readPick(layer, spot.view, pixel, ids, findLoadedTile(layer, spot.view, "depth", pixel.tile)) ?? { ...EMPTY_PICK, approximate: z < frame.zmax };
  }
  return null;
}

/** Layers that show something at a point, uppermost first; those of a group hide each other by depth. */
function groupsAt(layers: readonly imageLayer[], { camera }: ViewState, [x, y]: Vec2): (readonly imageLayer[])[] {
  const point: Vec2 = [x / camera.width, y / camera.height];
  return [...groupByDepth(layers.filter((layer) => layer.showsAt(point)))].reverse();
}

/** Of what a group shows at a point, by the drawers' rule. */
function findNearest(picks: readonly (Pick | null)[], group: readonly imageLayer[], { camera: { frame, zoom }, origin }: ViewState): Pick | null {
  const far = (pick: Pick, k: number): number => (pick.position ? dot(frame.axes.forward, sub(pick.position, origin)) - computeBias(frame, zoom, k) : Infinity);
  const found = picks.flatMap((pick, k) => (pick ? [{ pick, far: group.length > 1 ? far(pick, k) : 0 }] : []));
  return found.reduce<(typeof found)[0] | null>((best, one) => (best && best.far < one.far ? best : one), null)?.pick ?? null;
}

interface ViewPoint {
  readonly view: View;
  readonly uv: Vec2;
}

function findViewPoint(layer: imageLayer, sight: ViewState, [x, y]: Vec2): ViewPoint | null {
  const { camera } = sight;
  const view = layer.findView(camera.frame);
  if (!view || !layer.rendering) return null;
  const [u, v] = computeCenter(view.frame, sight, layer.rendering);
  const px = cssPixelM(camera);
  return { view, uv: [u + (x - camera.width / 2) * px, v - (y - camera.height / 2) * px] };
}

async function fetchTile(layer: imageLayer, view: View, kind: LayerKind, tile: Tile): Promise<TileData | null> {
  const info = layer.rendering?.layers.get(kind);
  return info && layer.tiles ? layer.tiles.fetch(view, info, tile) : null;
}

function findLoadedTile(layer: imageLayer, view: View, kind: LayerKind, tile: Tile): TileData | null {
  const info = layer.rendering?.layers.get(kind);
  return (info && layer.tiles?.get(view, info, tile)?.data) ?? null;
}

interface TilePixel {
  tile: Tile;
  i: number;
  j: number;
}

/** null when nothing is there. */
function readPick(layer: imageLayer, view: View, pixel: TilePixel, ids: TileData | null, depths: TileData | null): Pick | null {
  const id = readValue(ids, pixel);
  const depth = readValue(depths, pixel) ?? NO_DEPTH;
  if ((!id && depth === NO_DEPTH) || layer.isHidden(id ?? 0)) return null;
  return { id: id ?? 0, position: computePosition(layer, view, pixel, depth), approximate: pixel.tile.z < view.frame.zmax, layer };
}

function readValue(data: TileData | null, { i, j }: TilePixel): number | undefined {
  return data?.kind === "id" || data?.kind === "depth" ? data.values[j * data.width + i] : undefined;
}

/** World coordinates of a pixel's centre. */
function computePosition(layer: imageLayer, { frame }: View, { tile, i, j }: TilePixel, depth: number): Vec3 | null {
  const rendering = layer.rendering;
  if (!rendering || depth === NO_DEPTH) return null;
  const unit = rendering.layers.get("depth")?.unit_m ?? DEPTH_UNIT_M;
  const [u, v] = uvOfPixel(frame, tile, i, j);
  return add(rendering.json.origin, localFromUvd(frame.axes, [u, v, frame.d0 + depth * unit]));
}

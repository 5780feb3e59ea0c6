import { add, dot, sub, type Vec2, type Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import { cssPixelM } from "../geo/camera";
import { ancestor, type Frame, type Tile } from "../geo/frame";
import type { LayerInfo, Rendering, View } from "../geo/manifest";
import type { LayerKind } from "../tiles/tileData";
import { corners } from "../core/vec";
import { computeBias, type DepthMapping } from "../draw/depthMapping";
import { placeQuads } from "../draw/quads";
import type { BakedLight, CustomLayer, Quad } from "../draw/drawer";
import { findCover, sortFromCenter, computeLevel, computeViewRect, findFallbacks } from "../tiles/cover";
import type { TileRequest } from "../tiles/queue";
import type { LayerTiles } from "../tiles/layerTiles";
import type { ViewState } from "./layerContext";

/** The quads to draw and the tiles to fetch of a layer for a camera. */
export interface LayerPlan {
  readonly view: View;
  readonly bakedLight: BakedLight;
  /** The pyramid layers in use, by kind. */
  readonly layers: ReadonlyMap<string, LayerInfo>;
  readonly level: number;
  readonly cover: readonly Tile[];
  readonly quads: readonly Quad[];
  readonly requests: readonly TileRequest[];
  readonly tiles: LayerTiles;
  /** Whether all tiles in view are in memory or known to be unavailable. */
  readonly complete: boolean;
  /** Tiles of the cover of which nothing is in memory, not even coarsely. */
  readonly uncovered: number;
}

/** Default unit of depth values. */
export const DEPTH_UNIT_M = 2 ** -10;

/** Tiles this many levels above the shown one are fetched first, so that something is visible soon. */
export const COARSE_STEPS = 3;

/** Computes U and V of the screen's centre in the layer's frame. */
export function computeCenter(frame: Frame, { camera, origin }: ViewState, rendering: Rendering): Vec2 {
  const shift = sub(origin, rendering.json.origin);
  return [camera.u + dot(frame.axes.right, shift), camera.v + dot(frame.axes.up, shift)];
}

/** The pyramid layers by kind, the baked light, the kinds that a tile needs, and those fetched after them. */
export interface LayerPlanInput {
  readonly bakedLight: BakedLight;
  readonly layers: ReadonlyMap<string, LayerInfo>;
  readonly needed: readonly LayerKind[];
  readonly extra: readonly LayerKind[];
}

export function planLayer(
  viewState: ViewState,
  rendering: Rendering,
  view: View,
  layerTiles: LayerTiles,
  { bakedLight, layers, needed, extra }: LayerPlanInput,
): LayerPlan {
  const { frame, occupancy } = view;
  const { camera, dpr, finer } = viewState;
  const [u, v] = computeCenter(frame, viewState, rendering);
  const px = cssPixelM(camera);
  const rect = computeViewRect(u, v, camera, px);
  const level = computeLevel(frame, px / dpr, dpr, finer);
  const occupied = (tile: Tile): boolean => occupancy.has(tile);
  const cover = findCover(frame, occupied, level, rect);
  const inMemory = (kind: LayerKind, tile: Tile): boolean => isInMemory(layers, layerTiles, view, kind, tile);
  const ready = (tile: Tile): boolean => needed.every((kind) => inMemory(kind, tile));
  const screen = { left: rect[0][0], top: rect[1][1], px_m: px / dpr };
  const fallbacks = cover.map((tile) => findFallbacks(tile, ready, occupied));
  const quads = placeQuads(frame, screen, fallbacks.flat(), level);
  const ordered = sortFromCenter(frame, cover, rect);
  const requests = [
    ...listRequests(layers, layerTiles, view, needed, findAncestors(ordered)),
    ...listRequests(layers, layerTiles, view, needed, ordered),
    ...listRequests(layers, layerTiles, view, extra, ordered),
  ];
  return {
    view,
    bakedLight,
    layers,
    tiles: layerTiles,
    level,
    cover,
    quads,
    requests,
    complete: requests.length === 0,
    uncovered: fallbacks.filter(({ length }) => length === 0).length,
  };
}

/** Computes the minimum and maximum depth value of the rendering's box in a view. */
export function computeDepthRange(rendering: Rendering, { frame }: View): Vec2 {
  const unit = rendering.layers.get("depth")?.unit_m ?? DEPTH_UNIT_M;
  const depths = corners(rendering.json.box).map((corner) => (uvdFromLocal(frame.axes, corner)[2] - frame.d0) / unit);
  return [Math.min(...depths), Math.max(...depths)];
}

/** Computes the minimum and maximum D, along a frame, of all layers and custom layers of a map. */
export function computeSceneDepthRange(
  { origin }: ViewState,
  frame: Frame,
  layers: readonly { readonly rendering: Rendering | undefined }[],
  customLayers: readonly CustomLayer[],
): Vec2 {
  const { axes } = frame;
  const all = [
    ...customLayers.flatMap((custom) => custom.getDepthRange(frame) ?? []),
    ...layers.flatMap(({ rendering }) =>
      rendering ? corners(rendering.json.box).map((corner) => dot(axes.forward, sub(add(rendering.json.origin, corner), origin))) : [],
    ),
  ];
  return [Math.min(...all) - 1, Math.max(...all) + 1];
}

/** Makes the mapping that combines a layer with others on a map with this origin. @param before number of layers added before it */
export function makeDepthMapping(rendering: Rendering, { view, level }: LayerPlan, origin: Vec3, before: number): DepthMapping {
  const { frame } = view;
  const unit_m = rendering.layers.get("depth")?.unit_m ?? DEPTH_UNIT_M;
  const shift = uvdFromLocal(frame.axes, sub(rendering.json.origin, origin));
  const [near, far] = computeDepthRange(rendering, view).map((value) => frame.d0 + shift[2] + value * unit_m) as [number, number];
  return { frame, shift, unit_m, bias_m: computeBias(frame, level, before), range: [near, far] };
}

function findAncestors(tiles: readonly Tile[]): Tile[] {
  const found = new Map<string, Tile>();
  for (const tile of tiles) {
    const above = ancestor(tile, Math.min(COARSE_STEPS, tile.z));
    found.set(`${String(above.x)}/${String(above.y)}`, above);
  }
  return [...found.values()];
}

function isInMemory(layers: LayerPlanInput["layers"], layerTiles: LayerTiles, view: View, kind: LayerKind, tile: Tile): boolean {
  const layer = layers.get(kind);
  return layer !== undefined && layerTiles.get(view, layer, tile) !== undefined;
}

/** Lists requests for tiles that are neither in memory nor failed recently. */
function listRequests(
  layers: LayerPlanInput["layers"],
  layerTiles: LayerTiles,
  view: View,
  kinds: readonly LayerKind[],
  tiles: readonly Tile[],
): TileRequest[] {
  const requests: TileRequest[] = [];
  for (const tile of tiles) {
    for (const kind of kinds) {
      const layer = layers.get(kind);
      if (layer && !layerTiles.get(view, layer, tile) && !layerTiles.hasFailed(view, layer, tile))
        requests.push(layerTiles.makeRequest(view, layer, tile));
    }
  }
  return requests;
}

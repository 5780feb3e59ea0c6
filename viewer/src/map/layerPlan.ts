import { add, dot, sub, type Vec2, type Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import { cssPixelM } from "../geo/camera";
import { ancestor, type Frame, type Tile } from "../geo/frame";
import type { LayerInfo, LayerKind, Rendering, View } from "../geo/manifest";
import { corners } from "../core/vec";
import { computeBias, type DepthMapping } from "../draw/depthMapping";
import { placeQuads } from "../draw/quads";
import type { BakedLight, CustomLayer, Quad } from "../draw/drawer";
import { findCover, sortFromCenter, computeLevel, computeViewRect, findFallbacks } from "../tiles/cover";
import type { TileRequest } from "../tiles/queue";
import type { LayerTiles } from "../tiles/layerTiles";
import type { ViewState } from "./layerContext";

/** What a layer wants painted and fetched for a camera. */
export interface LayerPlan {
  readonly view: View;
  readonly baked: BakedLight;
  /** The layers that are shown, by kind. */
  readonly layers: ReadonlyMap<string, LayerInfo>;
  readonly level: number;
  readonly cover: readonly Tile[];
  readonly quads: readonly Quad[];
  readonly requests: readonly TileRequest[];
  /** Where its tiles are. */
  readonly store: LayerTiles;
  /** All of the view is here (or known not to come). */
  readonly complete: boolean;
}

/** Of depth values, when the manifest does not say. */
export const DEPTH_UNIT_M = 2 ** -10;

/** Levels above the shown one whose tiles are fetched first, so that something stands there soon. */
const COARSE_STEPS = 3;

/** U and V of the camera's middle in the layer's own frame. */
export function computeCenter(frame: Frame, { camera, origin }: ViewState, rendering: Rendering): Vec2 {
  const shift = sub(origin, rendering.json.origin);
  return [camera.u + dot(frame.axes.right, shift), camera.v + dot(frame.axes.up, shift)];
}

/** What a layer shows: its layers by kind, the light that was rendered, kinds without which a tile is not shown, and those that are fetched after them. */
export interface LayerPlanInput {
  readonly baked: BakedLight;
  readonly layers: ReadonlyMap<string, LayerInfo>;
  readonly needed: readonly LayerKind[];
  readonly extra: readonly LayerKind[];
}

export function planLayer(sight: ViewState, rendering: Rendering, view: View, store: LayerTiles, { baked, layers, needed, extra }: LayerPlanInput): LayerPlan {
  const { frame, occupancy } = view;
  const { camera, dpr, finer } = sight;
  const [u, v] = computeCenter(frame, sight, rendering);
  const px = cssPixelM(camera);
  const rect = computeViewRect(u, v, camera, px);
  const level = computeLevel(frame, px / dpr, dpr, finer);
  const occupied = (tile: Tile): boolean => occupancy.has(tile);
  const cover = findCover(frame, occupied, level, rect);
  const here = (kind: LayerKind, tile: Tile): boolean => isInMemory(layers, store, view, kind, tile);
  const ready = (tile: Tile): boolean => needed.every((kind) => here(kind, tile));
  const screen = { left: rect[0][0], top: rect[1][1], px_m: px / dpr };
  const quads = placeQuads(frame, screen, cover.flatMap((tile) => findFallbacks(tile, ready, occupied)), level);
  const ordered = sortFromCenter(frame, cover, rect);
  const requests = [
    ...listRequests(layers, store, view, needed, findAncestors(ordered)),
    ...listRequests(layers, store, view, needed, ordered),
    ...listRequests(layers, store, view, extra, ordered),
  ];
  return { view, baked, layers, store, level, cover, quads, requests, complete: requests.length === 0 };
}

/** Least and greatest depth value that the rendering's box can have in a view. */
export function computeDepthRange(rendering: Rendering, { frame }: View): Vec2 {
  const unit = rendering.layers.get("depth")?.unit_m ?? DEPTH_UNIT_M;
  const depths = corners(rendering.json.box).map((corner) => (uvdFromLocal(frame.axes, corner)[2] - frame.d0) / unit);
  return [Math.min(...depths), Math.max(...depths)];
}

/** Least and greatest D, along a frame, of all layers of a map and its guests. */
export function computeSceneDepthRange({ origin }: ViewState, frame: Frame, layers: readonly { readonly rendering: Rendering | undefined }[], guests: readonly CustomLayer[]): Vec2 {
  const { axes } = frame;
  const all = [...guests.flatMap((guest) => guest.getDepthRange(frame) ?? []), ...layers.flatMap(({ rendering }) => (rendering ? corners(rendering.json.box).map((corner) => dot(axes.forward, sub(add(rendering.json.origin, corner), origin))) : []))];
  return [Math.min(...all) - 1, Math.max(...all) + 1];
}

/** How a layer is combined with others on a map with this origin. @param before layers that were added before it */
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

function isInMemory(layers: LayerPlanInput["layers"], store: LayerTiles, view: View, kind: LayerKind, tile: Tile): boolean {
  const layer = layers.get(kind);
  return layer !== undefined && store.get(view, layer, tile) !== undefined;
}

/** Jobs for the tiles that are neither here nor known to have failed. */
function listRequests(layers: LayerPlanInput["layers"], store: LayerTiles, view: View, kinds: readonly LayerKind[], tiles: readonly Tile[]): TileRequest[] {
  const jobs: TileRequest[] = [];
  for (const tile of tiles) {
    for (const kind of kinds) {
      const layer = layers.get(kind);
      if (layer && !store.get(view, layer, tile) && !store.hasFailed(view, layer, tile)) jobs.push(store.makeRequest(view, layer, tile));
    }
  }
  return jobs;
}

import { add, clamp, sub, type Vec2, type Vec3 } from "../core/vec";
import { localFromUvd, uvdFromLocal } from "../geo/axes";
import { cssPixelM, uvFromScreen, type Camera } from "../geo/camera";
import { ancestor, childrenOf, pixelM, type Tile } from "../geo/frame";
import type { Rendering, View } from "../geo/manifest";
import { findCover, computeLevel, type Rect } from "../tiles/cover";
import type { LayerTiles } from "../tiles/layerTiles";
import { NO_DEPTH } from "../tiles/tileData";
import type { ImageLayer } from "./imageLayer";
import { DEPTH_UNIT_M } from "./layerPlan";
import type { ViewState } from "./layerContext";

/** Steepest continuous surface: metres of depth per metre across. */
const MAX_SLOPE = 8;
const MIN_BIAS_M = 0.05;

/**
 * Depths of the visible surface, read from the tiles in memory for many points of one picture. U, V and D are metres in the camera's frame, from
 * the camera's origin. With several layers, the nearest surface counts; hidden objects and invisible layers do not.
 */
export class VisibleDepths {
  readonly camera: Camera;
  readonly origin: Vec3;
  readonly dpr: number;
  /** The level that is read first. */
  readonly level: number;
  /** Metres per pixel of that level. */
  readonly pixel_m: number;
  /** Minimum and maximum height of the layers' content, local. */
  readonly heights: Vec2;
  readonly #layers: readonly LayerDepths[];
  readonly #bias_m: number;

  /** @param ids reads object ids as well, for `idAt` */
  constructor(layers: readonly ImageLayer[], viewState: ViewState, ids = false) {
    const { camera, origin, dpr, finer } = viewState;
    [this.camera, this.origin, this.dpr] = [camera, origin, dpr];
    const px = cssPixelM(camera) / dpr;
    this.level = computeLevel(camera.frame, px, dpr, finer);
    this.pixel_m = pixelM(camera.frame, this.level);
    const { up, forward } = camera.frame.axes;
    this.#bias_m = MIN_BIAS_M + (this.pixel_m / 2) * (1 + up[2] / Math.max(-forward[2], 0.05));
    const shown = layers.filter((layer) => layer.options.opacity > 0);
    this.#layers = shown.flatMap((layer) => LayerDepths.create(layer, viewState, px, ids) ?? []);
    const heights = shown.flatMap(({ rendering }) => rendering?.json.box.map(([, , z]) => z + rendering.json.origin[2] - origin[2]) ?? []);
    this.heights = heights.length > 0 ? [Math.min(...heights), Math.max(...heights)] : [0, 0];
  }

  /**
   * Fetches the depths of a rectangle (U and V of the camera's frame) at the deepest level where it has at most `maxTiles` tiles. Missing
   * tiles are replaced by those in memory; the result is `approximate` then, and where the level is not the deepest.
   */
  static async fetch(
    layers: readonly ImageLayer[],
    viewState: ViewState,
    [low, high]: Rect,
    maxTiles: number,
    ids = false,
  ): Promise<{ relief: VisibleDepths; approximate: boolean }> {
    const { frame } = viewState.camera;
    const across = (z: number): number =>
      (((high[0] - low[0]) * 2 ** z) / frame.size + 1) * (((high[1] - low[1]) * 2 ** z) / frame.size + 1);
    let zoom = frame.zmax;
    while (zoom > 0 && across(zoom) > maxTiles) zoom--;
    const relief = new VisibleDepths(layers, { ...viewState, camera: { ...viewState.camera, zoom }, dpr: 1, finer: 0 }, ids);
    await Promise.allSettled(relief.#layers.flatMap((layer) => layer.fetch([low, high])));
    relief.#layers.forEach((layer) => layer.clearPatches());
    // Tiles may have failed, or have been dropped before the last one arrived.
    return { relief, approximate: zoom < frame.zmax || !relief.#layers.every((layer) => layer.isLoaded([low, high])) };
  }

  /** Returns D of the nearest surface; Infinity where there is none, NaN where it is unknown. */
  depthAt(u: number, v: number): number {
    let nearest = Infinity;
    for (const layer of this.#layers) {
      const depth = layer.depthAt(u, v);
      if (Number.isNaN(depth)) return NaN;
      if (depth < nearest) nearest = depth;
    }
    return nearest;
  }

  /** Returns the object id of the nearest surface; 0 where there is none, or ids are not read. */
  idAt(u: number, v: number): number {
    let [nearest, id] = [Infinity, 0];
    for (const layer of this.#layers) {
      const depth = layer.depthAt(u, v);
      if (depth < nearest) [nearest, id] = [depth, layer.id];
    }
    return id;
  }

  /**
   * Whether a surface lies in front of a point. A surface does not hide its own points: counts the farthest of the 3 × 3 pixels around, as far as they continue
   * the point's own pixel (steps of up to 8 pixels), with a tolerance of 5 cm, half a pixel, and the rise of level ground over half a pixel. Unknown depths hide nothing.
   */
  isOccluded(u: number, v: number, d: number): boolean {
    const own = this.depthAt(u, v);
    const near = d - this.#bias_m;
    if (!(own < near)) return false;
    const farthest = own + MAX_SLOPE * this.pixel_m;
    for (let k = 0; k < 9; k++) {
      const neighbour = this.depthAt(u + ((k % 3) - 1) * this.pixel_m, v + (Math.floor(k / 3) - 1) * this.pixel_m);
      if (neighbour >= near && neighbour <= farthest) return false;
    }
    return true;
  }

  /** Whether a visible surface lies in front of a world position. */
  isPositionOccluded(world: Vec3): boolean {
    return this.isOccluded(...uvdFromLocal(this.camera.frame.axes, sub(world, this.origin)));
  }

  /** Returns the world position of the surface under CSS pixels; null where there is none, or it is unknown. */
  positionAt(point: Vec2): Vec3 | null {
    const [u, v] = uvFromScreen(this.camera, point);
    const d = this.depthAt(u, v);
    return Number.isFinite(d) ? add(this.origin, localFromUvd(this.camera.frame.axes, [u, v, d])) : null;
  }

  /** Lists what a rectangle's depths (U, V) are read from: while the list has the same members, the depths are the same. */
  sources(rect: Rect): unknown[] {
    return this.#layers.flatMap((layer) => layer.sources(rect));
  }
}

/** The source of a tile's depths: its own pixels or an ancestor's, those of its children, or none. */
type Patch = "empty" | "unknown" | ChildPatches | PixelPatch;

interface ChildPatches {
  readonly tile: Tile;
  /** TL, TR, BL, BR. */
  readonly children: readonly Patch[];
}

interface PixelPatch {
  readonly tile: Tile;
  readonly px: number;
  readonly depths: Uint32Array;
  /** null: not read. */
  readonly ids: Uint32Array | null;
}

/** Number of levels below the shown one that are searched. */
const CHILD_LEVELS = 2;

/** A layer's depths in the camera's frame. */
class LayerDepths {
  readonly #layer: ImageLayer;
  readonly #view: View;
  readonly #fetchTile: (kind: "depth" | "id", tile: Tile) => Promise<unknown>;
  readonly #read: (kind: "depth" | "id", tile: Tile) => Uint32Array | "empty" | undefined;
  readonly #level: number;
  /** Tiles per side of the level. */
  readonly #tilesPerSide: number;
  readonly #unit_m: number;
  /** Offset from the camera's U, V and D to the layer's. */
  readonly #shift: Vec3;
  readonly #patches = new Map<number, Patch>();
  readonly #ids: boolean;
  #last = -1;
  #patch: Patch = "empty";
  /** Id of the object whose depth was read last. */
  id = 0;

  static create(layer: ImageLayer, viewState: ViewState, px: number, ids: boolean): LayerDepths | null {
    const [view, { rendering, tiles }] = [layer.findView(viewState.camera.frame), layer];
    return view && tiles && rendering?.layers.has("depth") ? new LayerDepths(layer, view, rendering, tiles, viewState, px, ids) : null;
  }

  private constructor(
    layer: ImageLayer,
    view: View,
    { json, layers }: Rendering,
    store: LayerTiles,
    { origin, dpr, finer }: ViewState,
    px: number,
    ids: boolean,
  ) {
    [this.#layer, this.#view, this.#ids] = [layer, view, ids && layers.has("id")];
    this.#level = computeLevel(view.frame, px, dpr, finer);
    this.#tilesPerSide = 2 ** this.#level;
    this.#unit_m = layers.get("depth")?.unit_m ?? DEPTH_UNIT_M;
    this.#shift = uvdFromLocal(view.frame.axes, sub(origin, json.origin));
    this.#fetchTile = async (kind, tile) => {
      const info = layers.get(kind);
      return info && store.fetch(view, info, tile);
    };
    this.#read = (kind, tile) => {
      const info = layers.get(kind);
      const stored = info && store.get(view, info, tile);
      return stored?.empty ? "empty" : stored?.data?.kind === kind ? stored.data.values : undefined;
    };
  }

  depthAt(u: number, v: number): number {
    const { frame } = this.#view;
    const side = this.#tilesPerSide;
    const right = u + this.#shift[0] - frame.u0;
    const down = frame.v0 - v - this.#shift[1];
    const x = Math.floor((right * side) / frame.size);
    const y = Math.floor((down * side) / frame.size);
    if (!(x >= 0 && y >= 0 && x < side && y < side)) return Infinity;
    if (y * side + x !== this.#last) {
      this.#last = y * side + x;
      this.#patch = this.#getPatch({ z: this.#level, x, y });
    }
    return this.#readDepth(this.#patch, right, down);
  }

  /** Fetches the tiles of a rectangle. */
  fetch([low, high]: Rect): Promise<unknown>[] {
    const kinds = this.#readsIds ? (["depth", "id"] as const) : (["depth"] as const);
    return this.#tilesIn([low, high]).flatMap((tile) => kinds.map((kind) => this.#fetchTile(kind, tile)));
  }

  /** Whether they are all in memory, at the shown level. */
  isLoaded(rect: Rect): boolean {
    return this.#tilesIn(rect).every((tile) => {
      const patch = this.#getPatch(tile);
      return patch === "empty" || (typeof patch === "object" && "depths" in patch && patch.tile.z === this.#level);
    });
  }

  get #readsIds(): boolean {
    return this.#ids || this.#layer.drawStyles !== null;
  }

  /** Forgets patches, so that they are looked up again. */
  clearPatches(): void {
    this.#patches.clear();
    this.#last = -1;
  }

  #tilesIn([low, high]: Rect): Tile[] {
    const { frame, occupancy } = this.#view;
    const [du, dv] = this.#shift;
    return findCover(frame, (tile) => occupancy.has(tile), this.#level, [
      [low[0] + du, low[1] + dv],
      [high[0] + du, high[1] + dv],
    ]);
  }

  sources(rect: Rect): unknown[] {
    const of = (patch: Patch): unknown[] =>
      typeof patch === "string" ? [patch] : "children" in patch ? patch.children.flatMap(of) : [patch.depths];
    return [this.#layer.drawStyles, ...this.#tilesIn(rect).flatMap((tile) => of(this.#getPatch(tile)))];
  }

  #readDepth(patch: Patch, right: number, down: number): number {
    if (typeof patch === "string") return patch === "empty" ? Infinity : NaN;
    const { tilePx, d0, size } = this.#view.frame;
    const { z, x, y } = patch.tile;
    if ("children" in patch) {
      const half = size / 2 ** (z + 1);
      return this.#readDepth(
        patch.children[(right >= (2 * x + 1) * half ? 1 : 0) + (down >= (2 * y + 1) * half ? 2 : 0)] as Patch,
        right,
        down,
      );
    }
    const i = clamp(Math.floor(right / patch.px) - x * tilePx, 0, tilePx - 1);
    const j = clamp(Math.floor(down / patch.px) - y * tilePx, 0, tilePx - 1);
    const depth = patch.depths[j * tilePx + i] as number;
    this.id = patch.ids?.[j * tilePx + i] ?? 0;
    if (depth === NO_DEPTH || (patch.ids && this.#layer.isHidden(this.id))) return Infinity;
    return d0 + depth * this.#unit_m - this.#shift[2];
  }

  #getPatch(tile: Tile): Patch {
    const at = tile.y * this.#tilesPerSide + tile.x;
    const patch = this.#patches.get(at) ?? this.#findPatch(tile);
    this.#patches.set(at, patch);
    return patch;
  }

  #findPatch(tile: Tile): Patch {
    const below = this.#findChildPatch(tile, CHILD_LEVELS);
    if (below) return below;
    for (let up = 1; up <= tile.z; up++) {
      const above = this.#findOwnPatch(ancestor(tile, up));
      if (above) return above;
    }
    return "unknown";
  }

  #findOwnPatch(tile: Tile): Patch | undefined {
    if (!this.#view.occupancy.has(tile)) return "empty";
    const [depths, ids] = [this.#read("depth", tile), this.#readsIds ? this.#read("id", tile) : null];
    if (depths === "empty" || ids === "empty") return "empty";
    return depths && ids !== undefined ? { tile, px: pixelM(this.#view.frame, tile.z), depths, ids } : undefined;
  }

  #findChildPatch(tile: Tile, down: number): Patch | undefined {
    const own = this.#findOwnPatch(tile);
    if (own ?? (down === 0 || tile.z === this.#view.frame.zmax)) return own;
    const children = childrenOf(tile).map((child) => this.#findChildPatch(child, down - 1));
    return children.every((child) => child !== undefined) ? { tile, children } : undefined;
  }
}

import type { Tile } from "../../geo/frame";
import type { LayerKind } from "../../tiles/tileData";
import { findFallbacks } from "../../tiles/cover";
import { listRequiredKinds, type Drawer, type DrawerEvents, type FrameContent, type LayerPass, type Quad } from "../drawer";
import { overlaps } from "../depthMapping";
import type { DrawStyles } from "../drawStyle";
import { listNeighbourKinds, listKinds, makeShadingOptions, restrictOptions, type ShadingOptions } from "./shadingOptions";
import { makeMask, type Mask } from "./mask";
import { TilePictures, type TilePicture, type PictureRequest } from "./tilePictures";
import type { ShadeRequest, TileImage } from "./shadeMessages";
import { findArea, makeGrid, type Grid, type MosaicTile } from "./tileMosaic";
import { CssCompositor, CanvasCompositor, type Compositor, type ComposedPass } from "./compositor";

type IdValues = LayerPass["highlight"] | DrawStyles;

/** A visible tile. */
interface WantedTile {
  readonly from: Tile;
  readonly options: ShadingOptions;
  readonly layers: ShadeRequest["layers"];
  /** Distance from the screen's centre, device pixels. */
  readonly distance: number;
}

/** Draws on 2D canvases. A worker shades the tiles; until a tile is ready, others take its place. */
export class CanvasDrawer implements Drawer {
  readonly name = "canvas";
  readonly gl = null;
  readonly #compositor: Compositor;
  readonly #pictures: TilePictures;
  /** The worker's data, each with the picture that uses it. */
  readonly #uploaded = new Map<string, TilePicture>();
  /** The worker's highlights and styles, with their names. */
  readonly #valueNames = new Map<IdValues, string>();
  #tilePx = 0;
  #nameCount = 0;
  /** Id of the view in the picture. */
  #shownView: string | undefined;
  showsPreviousView = false;

  /** @param preserve draws on the canvas itself, so that its pixels can be read  @throws DrawError when the canvas has another context, or the browser has no 2D canvas */
  constructor(canvas: HTMLCanvasElement, preserve: boolean, events: DrawerEvents) {
    this.#compositor = new (preserve ? CanvasCompositor : CssCompositor)(canvas, () => events.changed());
    this.#pictures = new TilePictures({
      made: () => events.changed(),
      failed: (error) => events.failed(error),
    });
  }

  get busy(): boolean {
    return this.#pictures.busy;
  }

  get element(): HTMLElement {
    return this.#compositor.element;
  }

  draw(frame: FrameContent): void {
    const wanted = frame.passes.map((pass) => [pass, this.#uploadPass(frame, pass)] as const);
    const requests = wanted.flatMap(([pass, tiles]) =>
      [...tiles].map(([name, tile]) => this.#makeRequest(frame.passes, pass, this.#pictures.getOrCreate(name), tile)),
    );
    this.#pictures.setRequests(requests.filter(({ urgency }) => urgency.length > 0));
    const view = frame.camera.frame.id;
    this.showsPreviousView = view !== (this.#shownView ??= view) && this.busy && !frame.passes.every((pass) => this.#isCovered(pass));
    if (!this.showsPreviousView)
      this.#compositor.show(
        frame,
        wanted.flatMap(([pass, tiles]) => this.#composePass(pass, tiles)),
      );
    if (!this.showsPreviousView) this.#shownView = view;
    this.#dropUnused(frame.passes);
    if (this.busy) return;
    const [seen, current] = [new Set(requests.map(({ picture }) => picture)), new Set(requests.map(({ options }) => options))];
    this.#pictures.prune((picture) => !seen.has(picture) && !current.has(picture.options));
  }

  release(key: string): void {
    const picture = this.#uploaded.get(key);
    if (!picture) return;
    this.#uploaded.delete(key);
    this.#pictures.drop(key);
    picture.inputs.delete(key);
    if (picture.inputs.size === 0) this.#pictures.forget(picture.name);
  }

  destroy(): void {
    this.#pictures.stop();
    this.#compositor.remove();
    this.#uploaded.clear();
  }

  /** Sends the worker missing data. @returns the visible tiles by picture name */
  #uploadPass(frame: FrameContent, pass: LayerPass): Map<string, WantedTile> {
    const names = {
      highlight: pass.highlight.size > 0 ? this.#uploadValues(pass.highlight) : null,
      styles: pass.drawStyles && this.#uploadValues(pass.drawStyles),
    };
    const wanted = new Map<string, WantedTile>();
    for (const { from, rect, scale } of pass.quads) {
      const name = makeName(pass, from);
      const distance = Math.hypot((rect[0] + rect[2] - frame.width) / 2, (rect[1] + rect[3] - frame.height) / 2);
      const known = wanted.get(name);
      const options = known?.options ?? makeShadingOptions(frame, pass, scale, names);
      const layers = known?.layers ?? this.#uploadTile(pass, options, from);
      if (layers) wanted.set(name, { from, options, layers, distance: Math.min(distance, known?.distance ?? distance) });
    }
    return wanted;
  }

  /** Sends the worker a tile's data. @returns the names of its layers; null when a required layer is missing */
  #uploadTile(pass: LayerPass, options: ShadingOptions, tile: Tile): ShadeRequest["layers"] | null {
    const picture = this.#pictures.getOrCreate(makeName(pass, tile));
    const layers: Partial<Record<LayerKind, string>> = {};
    for (const kind of listKinds(options)) {
      const key = pass.tiles.key(kind, tile);
      const data = this.#uploaded.has(key) ? null : pass.tiles.data(kind, tile);
      if (data) {
        this.#tilePx = data.width;
        this.#pictures.put(key, data, "bitmap" in data ? [data.bitmap] : data.kind === "normal" ? [data.values.buffer] : []);
        this.#uploaded.set(key, picture);
        picture.inputs.add(key);
        pass.tiles.onUploaded(kind, tile);
      }
      if (this.#uploaded.has(key)) layers[kind] = key;
    }
    return listRequiredKinds(options.mode, options.masked, options.combined).every((kind) => layers[kind] !== undefined) ? layers : null;
  }

  #composePass(pass: LayerPass, wanted: ReadonlyMap<string, WantedTile>): ComposedPass[] {
    const { mode, opacity, clip, quads } = pass;
    const grid = makeGrid(pass, this.#tilePx);
    if (!grid || this.#tilePx === 0) return [];
    const mosaic = quads.filter(({ from }) => wanted.has(makeName(pass, from))).flatMap((quad) => this.#findMosaicTiles(pass, grid, quad));
    return mosaic.length > 0
      ? [{ grid, tiles: mosaic, smooth: mode === "lit" || mode === "color" || mode === "picture", opacity, clip }]
      : [];
  }

  /** Whether there are pictures for all quads of a pass, if only coarse ones. */
  #isCovered(pass: LayerPass): boolean {
    const grid = makeGrid(pass, this.#tilePx);
    return !grid || pass.quads.every((quad) => this.#findMosaicTiles(pass, grid, quad).length > 0);
  }

  /** Finds the pictures that fill a quad: its own, or those of descendants or of an ancestor. */
  #findMosaicTiles(pass: LayerPass, grid: Grid, { from, rect }: Quad): MosaicTile[] {
    const area = findArea(grid, rect);
    const imageOf = (tile: Tile): TileImage | undefined => this.#pictures.get(makeName(pass, tile))?.image;
    const own = imageOf(from);
    if (own) return [{ area, from, image: own }];
    const fallbacks = findFallbacks(
      area,
      (tile) => imageOf(tile) !== undefined,
      () => true,
      area.z > grid.level ? 0 : 2,
    );
    return fallbacks.map((fallback) => ({ ...fallback, image: imageOf(fallback.from) as TileImage }));
  }

  /** Makes a request; an up-to-date picture has an empty urgency. */
  #makeRequest(
    passes: readonly LayerPass[],
    pass: LayerPass,
    picture: TilePicture,
    { from, options, layers, distance }: WantedTile,
  ): PictureRequest {
    const { tiles } = pass;
    const restricted = { ...restrictOptions(options, (kind) => layers[kind] !== undefined), masks: this.#findMasks(passes, pass, from) };
    const neighbours: Partial<Record<LayerKind, string[]>> = {};
    let edges = 0;
    for (const [number, kind] of listNeighbourKinds(restricted).entries()) {
      const keys = NEIGHBOURS.map(([dx, dy]) => tiles.key(kind, { z: from.z, x: from.x + dx, y: from.y + dy }));
      keys.forEach((key, k) => (edges |= this.#uploaded.has(key) ? 1 << (k + 4 * number) : 0));
      neighbours[kind] = keys;
    }
    const text = JSON.stringify(restricted);
    return {
      picture,
      options: text,
      edges,
      request: { options: restricted, layers, neighbours },
      urgency: computeUrgency(picture, text, edges, distance),
    };
  }

  /** Finds tiles of other layers that may hide parts of this tile. */
  #findMasks(passes: readonly LayerPass[], { depths, clip, tiles }: LayerPass, from: Tile): Mask[] {
    if (!depths) return [];
    const others = passes.filter((other) => other.tiles !== tiles && other.depths && other.opacity === 1 && overlaps(clip, other.clip));
    return others.flatMap((other) => {
      const above = new Map(other.quads.map((quad) => [other.tiles.key("depth", quad.from), quad.from]));
      return [...above].flatMap(([depth, tile]) => {
        const color = other.tiles.key(other.mode === "picture" ? "picture" : "color", tile);
        const mask =
          other.depths && this.#uploaded.has(depth)
            ? makeMask(depths, from, other.depths, tile, { depth, color: other.masked || !this.#uploaded.has(color) ? null : color })
            : null;
        return mask ? [mask] : [];
      });
    });
  }

  #uploadValues(values: IdValues): string {
    const known = this.#valueNames.get(values);
    if (known !== undefined) return known;
    const name = `values${String(this.#nameCount++)}`;
    this.#pictures.put(name, values);
    this.#valueNames.set(values, name);
    return name;
  }

  #dropUnused(passes: readonly LayerPass[]): void {
    for (const [values, name] of this.#valueNames) {
      if (passes.some(({ highlight, drawStyles }) => highlight === values || drawStyles === values)) continue;
      this.#pictures.drop(name);
      this.#valueNames.delete(values);
    }
  }
}

const NEIGHBOURS = [
  [-1, 0],
  [1, 0],
  [0, -1],
  [0, 1],
] as const;

/** The name of a tile's picture in any mode. */
const makeName = ({ tiles, mode }: LayerPass, tile: Tile): string =>
  tiles.key("color", tile) || tiles.key(mode === "lit" ? "color" : mode, tile);

/** Missing pictures come first, then outdated ones (oldest first), then edges; all from the screen's centre outwards. */
function computeUrgency(picture: TilePicture, options: string, edges: number, distance: number): number[] {
  if (picture.options !== options) return picture.image ? [1, picture.ticket, distance] : [0, 0, distance];
  return (edges & ~picture.edges) === 0 ? [] : [2, 0, distance];
}

import type { Tile } from "../../geo/frame";
import type { TileFallback } from "../../tiles/cover";
import { DrawError } from "../../core/errors";
import type { LayerPass, FrameState } from "../drawer";
import type { TileImage } from "./shadeMessages";

/** The position of a level's pixels on the screen. */
export interface Grid {
  readonly level: number;
  readonly tilePx: number;
  /** Position of the level's first pixel, device pixels. */
  readonly left: number;
  readonly top: number;
  /** Device pixels per tile pixel. */
  readonly px: number;
}

/** Computes a pass's grid; null when it has no quads. */
export function makeGrid({ quads: [quad], level }: LayerPass, tilePx: number): Grid | null {
  if (!quad) return null;
  const side = tilePx / quad.scale;
  return {
    level,
    tilePx,
    left: quad.origin[0] - quad.from.x * side,
    top: quad.origin[1] - quad.from.y * side,
    px: 2 ** (quad.from.z - level) / quad.scale,
  };
}

/** Finds the tile that covers a rectangle of the screen. */
export function findArea({ level, tilePx, left, top, px }: Grid, [x0, y0, x1]: readonly number[]): Tile {
  const side = (x1 ?? 0) - (x0 ?? 0);
  return {
    z: level + Math.round(Math.log2((tilePx * px) / side)),
    x: Math.round(((x0 ?? 0) - left) / side),
    y: Math.round(((y0 ?? 0) - top) / side),
  };
}

/** Computes a tile's window: integers, and the same for an edge whichever tile it belongs to. */
function computeWindow({ level, tilePx }: Grid, { z, x, y }: Tile): PixelWindow {
  const side = tilePx * 2 ** (level - z);
  return [Math.round(x * side), Math.round(y * side), Math.round((x + 1) * side), Math.round((y + 1) * side)];
}

export interface MosaicTile extends TileFallback {
  readonly image: TileImage;
}

/** Left, top, right and bottom in pixels of a level. */
export type PixelWindow = readonly [number, number, number, number];

type ScreenSize = Pick<FrameState, "width" | "height">;

/** The current content of a mosaic. */
interface MosaicContent {
  readonly grid: Grid;
  readonly smooth: boolean;
  readonly window: PixelWindow;
  /** Tiles by area. */
  readonly tiles: Map<string, MosaicTile>;
}

/** Canvas sizes are multiples of this, so that they rarely change. */
const SIDE_STEP_PX = 32;

/**
 * A canvas with the visible tiles at whole pixels of their level, shown scaled as one picture, so that seams cannot
 * appear. A transparent border keeps the outer edges as soft as inner ones.
 */
export class TileMosaic {
  readonly #context: CanvasRenderingContext2D;
  #content: MosaicContent | null = null;

  /** @throws DrawError when the browser has no 2D canvas */
  constructor() {
    this.#context = getContext2d(document.createElement("canvas"));
  }

  get canvas(): HTMLCanvasElement {
    return this.#context.canvas;
  }

  /**
   * Draws the visible tiles and `margin` pixels around them; keeps what is already there.
   * @param smooth interpolates between pixels; not for ids and the like  @returns the window of the canvas's content, from its top left corner; null: nothing is visible
   */
  update(screen: ScreenSize, grid: Grid, tiles: readonly MosaicTile[], smooth: boolean, margin: number): PixelWindow | null {
    const visible = computeVisibleWindow(screen, grid, 0);
    if (!visible) return this.empty();
    const content =
      this.#content && containsWindow(this.#content, visible, grid, smooth)
        ? this.#content
        : this.#restart(grid, smooth, computeVisibleWindow(screen, grid, margin) ?? visible);
    const wanted = new Map(
      tiles.filter(({ area }) => intersects(computeWindow(grid, area), content.window)).map((tile) => [makeKey(tile), tile]),
    );
    for (const [key, { area }] of content.tiles) {
      if (wanted.has(key)) continue;
      this.#clear(grid, area);
      content.tiles.delete(key);
    }
    const drawables: Drawables = new Map();
    for (const [key, tile] of wanted) {
      if (content.tiles.get(key)?.image === tile.image) continue;
      this.#drawTile(grid, content.window, tile, drawables);
      content.tiles.set(key, tile);
    }
    return content.window;
  }

  /** Forgets the content, which the browser has lost. */
  invalidate(): void {
    this.#content = null;
  }

  /** Clears it and frees its memory. */
  empty(): null {
    Object.assign(this.canvas, { width: 0, height: 0 });
    this.#content = null;
    return null;
  }

  /** Clears the canvas for a new window. */
  #restart(grid: Grid, smooth: boolean, window: PixelWindow): MosaicContent {
    const [{ canvas }, [x0, y0, x1, y1]] = [this, window];
    const side = (is: number, need: number): number => (is < need || is > 2 * need ? Math.ceil(need / SIDE_STEP_PX) * SIDE_STEP_PX : is);
    const [w, h] = [side(canvas.width, x1 - x0), side(canvas.height, y1 - y0)];
    if (w !== canvas.width || h !== canvas.height) [canvas.width, canvas.height] = [w, h];
    this.#context.setTransform(1, 0, 0, 1, 0, 0);
    this.#context.clearRect(0, 0, w, h);
    this.#context.translate(-x0, -y0);
    this.#context.imageSmoothingEnabled = smooth;
    return (this.#content = { grid, smooth, window, tiles: new Map() });
  }

  #clear(grid: Grid, area: Tile): void {
    const [x0, y0, x1, y1] = computeWindow(grid, area);
    this.#context.clearRect(x0, y0, x1 - x0, y1 - y0);
  }

  #drawTile(grid: Grid, [left, top]: PixelWindow, { area, from, image }: MosaicTile, drawables: Drawables): void {
    const [x0, y0, x1, y1] = computeWindow(grid, area);
    if (from.z === area.z && "data" in image && image.width === x1 - x0) {
      this.#context.putImageData(image, x0 - left, y0 - top);
      return;
    }
    this.#clear(grid, area);
    if (from.z !== area.z) this.#drawAncestorPart(area, from, toDrawable(image, drawables), [x0, y0, x1, y1]);
    else this.#context.drawImage(toDrawable(image, drawables), x0, y0, x1 - x0, y1 - y0);
  }

  /** Draws part of an ancestor, with a margin of pixels, so that it joins its neighbours smoothly. */
  #drawAncestorPart(area: Tile, from: Tile, image: ImageBitmap | OffscreenCanvas, [x0, y0, x1, y1]: PixelWindow): void {
    const context = this.#context;
    const parts = 2 ** (area.z - from.z);
    const side = image.width / parts;
    const [u, v] = [(area.x - from.x * parts) * side, (area.y - from.y * parts) * side];
    const [left, top] = [Math.max(Math.floor(u) - 1, 0), Math.max(Math.floor(v) - 1, 0)];
    const [right, bottom] = [Math.min(Math.ceil(u + side) + 1, image.width), Math.min(Math.ceil(v + side) + 1, image.height)];
    const scale = (x1 - x0) / side;
    context.save();
    context.beginPath();
    context.rect(x0, y0, x1 - x0, y1 - y0);
    context.clip();
    context.drawImage(
      image,
      left,
      top,
      right - left,
      bottom - top,
      x0 + (left - u) * scale,
      y0 + (top - v) * scale,
      (right - left) * scale,
      (bottom - top) * scale,
    );
    context.restore();
  }
}

type Drawables = Map<TileImage, ImageBitmap | OffscreenCanvas>;

/** Converts an image to a form that can be drawn scaled. @param known earlier conversions: one tile may fill many areas */
function toDrawable(image: TileImage, known: Drawables): ImageBitmap | OffscreenCanvas {
  const made = known.get(image) ?? ("data" in image ? makeCanvas(image) : image);
  known.set(image, made);
  return made;
}

function makeCanvas(image: ImageData): OffscreenCanvas {
  const canvas = new OffscreenCanvas(image.width, image.height);
  canvas.getContext("2d")?.putImageData(image, 0, 0);
  return canvas;
}

/** Returns a canvas's 2D context. @throws DrawError when the canvas has another context, or the browser has no 2D canvas */
export function getContext2d(canvas: HTMLCanvasElement): CanvasRenderingContext2D {
  const context = canvas.getContext("2d");
  if (!context) throw new DrawError("this browser supports neither WebGL2 nor the 2D canvas; update it");
  return context;
}

/** Computes the visible window of the level, with `margin` pixels and one more; null: nothing is visible. */
function computeVisibleWindow({ width, height }: ScreenSize, { level, tilePx, left, top, px }: Grid, margin: number): PixelWindow | null {
  const side = tilePx * 2 ** level;
  const [x0, y0] = [left, top].map((at) => Math.max(0, Math.floor(-at / px) - margin) - 1) as [number, number];
  const [x1, y1] = [
    Math.min(side, Math.ceil((width - left) / px) + margin) + 1,
    Math.min(side, Math.ceil((height - top) / px) + margin) + 1,
  ];
  return x1 - x0 > 2 && y1 - y0 > 2 ? [x0, y0, x1, y1] : null;
}

const intersects = (a: PixelWindow, b: PixelWindow): boolean => a[0] < b[2] && a[1] < b[3] && a[2] > b[0] && a[3] > b[1];

/** Whether the content covers the visible window on the same grid. */
const containsWindow = ({ grid, smooth, window }: MosaicContent, visible: PixelWindow, now: Grid, smoothNow: boolean): boolean =>
  grid.level === now.level &&
  grid.tilePx === now.tilePx &&
  smooth === smoothNow &&
  visible[0] >= window[0] &&
  visible[1] >= window[1] &&
  visible[2] <= window[2] &&
  visible[3] <= window[3];

const makeKey = ({ area }: MosaicTile): string => `${String(area.z)}/${String(area.x)}/${String(area.y)}`;

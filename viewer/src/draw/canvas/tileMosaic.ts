import type { Tile } from "../../geo/frame";
import type { TileFallback } from "../../tiles/cover";
import { DrawError } from "../../core/errors";
import type { Pass, FrameState } from "../drawer";
import type { TileImage } from "./shadeMessages";

/** Where the tile pixels of the shown level lie on the screen. */
export interface Grid {
  readonly level: number;
  readonly tilePx: number;
  /** Device pixels of the level's first pixel. */
  readonly left: number;
  readonly top: number;
  /** Device pixels a tile pixel. */
  readonly px: number;
}

/** null when the pass paints nothing. */
export function makeGrid({ quads: [quad], level }: Pass, tilePx: number): Grid | null {
  if (!quad) return null;
  const side = tilePx / quad.scale;
  return { level, tilePx, left: quad.origin[0] - quad.from.x * side, top: quad.origin[1] - quad.from.y * side, px: 2 ** (quad.from.z - level) / quad.scale };
}

/** The square that a rectangle of the screen is. */
export function findArea({ level, tilePx, left, top, px }: Grid, [x0, y0, x1]: readonly number[]): Tile {
  const side = (x1 ?? 0) - (x0 ?? 0);
  return { z: level + Math.round(Math.log2((tilePx * px) / side)), x: Math.round(((x0 ?? 0) - left) / side), y: Math.round(((y0 ?? 0) - top) / side) };
}

/** Left, top, right, bottom in pixels of the level; whole, and the same for an edge whichever tile it belongs to. */
function computeWindow({ level, tilePx }: Grid, { z, x, y }: Tile): PixelWindow {
  const side = tilePx * 2 ** (level - z);
  return [Math.round(x * side), Math.round(y * side), Math.round((x + 1) * side), Math.round((y + 1) * side)];
}

export interface MosaicTile extends TileFallback {
  readonly image: TileImage;
}

/** Left, top, right, bottom: pixels of a level. */
export type PixelWindow = readonly [number, number, number, number];

type ScreenSize = Pick<FrameState, "width" | "height">;

/** What a sheet holds. */
interface MosaicContent {
  readonly grid: Grid;
  readonly smooth: boolean;
  readonly window: PixelWindow;
  /** By their area. */
  readonly tiles: Map<string, MosaicTile>;
}

/** A canvas has sides of whole multiples, so that it need not change with each picture. */
const SIDE_STEP_PX = 32;

/**
 * Tiles put together at whole pixels of their level, to be seen scaled as one picture: no seam can show, since there is
 * none. A border of nothing around them keeps their outer edges as soft as inner ones.
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
   * Puts together what is seen of the pieces and so many pixels `beyond`; what it holds already stays as it is.
   * @param smooth mixes colours between pixels; ids and the like are not to be mixed  @returns what the canvas holds, from its left top corner on; null: nothing is seen
   */
  update(screen: ScreenSize, grid: Grid, pieces: readonly MosaicTile[], smooth: boolean, beyond: number): PixelWindow | null {
    const seen = computeVisibleWindow(screen, grid, 0);
    if (!seen) return this.empty();
    const held = this.#content && containsWindow(this.#content, seen, grid, smooth) ? this.#content : this.#restart(grid, smooth, computeVisibleWindow(screen, grid, beyond) ?? seen);
    const wanted = new Map(pieces.filter(({ area }) => intersects(computeWindow(grid, area), held.window)).map((piece) => [makeKey(piece), piece]));
    for (const [key, { area }] of held.tiles) {
      if (wanted.has(key)) continue;
      this.#clear(grid, area);
      held.tiles.delete(key);
    }
    const drawables: Drawables = new Map();
    for (const [key, piece] of wanted) {
      if (held.tiles.get(key)?.image === piece.image) continue;
      this.#drawTile(grid, held.window, piece, drawables);
      held.tiles.set(key, piece);
    }
    return held.window;
  }

  /** What it held is gone. */
  invalidate(): void {
    this.#content = null;
  }

  /** Gives its memory back. */
  empty(): null {
    Object.assign(this.canvas, { width: 0, height: 0 });
    this.#content = null;
    return null;
  }

  /** Nothing yet. */
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

  /** Part of an ancestor, with the pixels around it, so that what is beside it goes on smoothly. */
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
    context.drawImage(image, left, top, right - left, bottom - top, x0 + (left - u) * scale, y0 + (top - v) * scale, (right - left) * scale, (bottom - top) * scale);
    context.restore();
  }
}

type Drawables = Map<TileImage, ImageBitmap | OffscreenCanvas>;

/** Pixels in a form that can be drawn scaled. @param known made before: one tile may stand in for many */
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

/** @throws DrawError when the canvas has another context already, or the browser no 2D canvas */
export function getContext2d(canvas: HTMLCanvasElement): CanvasRenderingContext2D {
  const context = canvas.getContext("2d");
  if (!context) throw new DrawError("this browser offers neither WebGL2 nor a 2D canvas, of which the map needs one to draw; update it");
  return context;
}

/** What is seen of the level, so much beyond, and one pixel more; null: nothing. */
function computeVisibleWindow({ width, height }: ScreenSize, { level, tilePx, left, top, px }: Grid, beyond: number): PixelWindow | null {
  const side = tilePx * 2 ** level;
  const [x0, y0] = [left, top].map((at) => Math.max(0, Math.floor(-at / px) - beyond) - 1) as [number, number];
  const [x1, y1] = [Math.min(side, Math.ceil((width - left) / px) + beyond) + 1, Math.min(side, Math.ceil((height - top) / px) + beyond) + 1];
  return x1 - x0 > 2 && y1 - y0 > 2 ? [x0, y0, x1, y1] : null;
}

const intersects = (a: PixelWindow, b: PixelWindow): boolean => a[0] < b[2] && a[1] < b[3] && a[2] > b[0] && a[3] > b[1];

/** Is there room for all that is seen? */
const containsWindow = ({ grid, smooth, window }: MosaicContent, seen: PixelWindow, now: Grid, smoothNow: boolean): boolean =>
  grid.level === now.level && grid.tilePx === now.tilePx && smooth === smoothNow && seen[0] >= window[0] && seen[1] >= window[1] && seen[2] <= window[2] && seen[3] <= window[3];

const makeKey = ({ area }: MosaicTile): string => `${String(area.z)}/${String(area.x)}/${String(area.y)}`;

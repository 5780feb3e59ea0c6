import type { Tile } from "../../geo/frame";
import type { Stand } from "../../tiles/cover";
import { DrawError } from "../../core/errors";
import type { Pass, Setting } from "../drawer";

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
export function gridOf({ quads: [quad], level }: Pass, tilePx: number): Grid | null {
  if (!quad) return null;
  const side = tilePx / quad.scale;
  return { level, tilePx, left: quad.origin[0] - quad.from.x * side, top: quad.origin[1] - quad.from.y * side, px: 2 ** (quad.from.z - level) / quad.scale };
}

/** The square that a rectangle of the screen is. */
export function areaOf({ level, tilePx, left, top, px }: Grid, [x0, y0, x1]: readonly number[]): Tile {
  const side = (x1 ?? 0) - (x0 ?? 0);
  return { z: level + Math.round(Math.log2((tilePx * px) / side)), x: Math.round(((x0 ?? 0) - left) / side), y: Math.round(((y0 ?? 0) - top) / side) };
}

/** Left, top, right, bottom in pixels of the level; whole, and the same for an edge whichever tile it belongs to. */
function placeOf({ level, tilePx }: Grid, { z, x, y }: Tile): [number, number, number, number] {
  const side = tilePx * 2 ** (level - z);
  return [Math.round(x * side), Math.round(y * side), Math.round((x + 1) * side), Math.round((y + 1) * side)];
}

export interface Piece extends Stand {
  readonly bitmap: ImageBitmap;
}

/** Left, top, right, bottom: pixels of a level. */
export type Window = readonly [number, number, number, number];

/** What a sheet holds. */
interface Held {
  readonly grid: Grid;
  readonly smooth: boolean;
  readonly window: Window;
  readonly pieces: readonly Piece[];
}

/** A canvas has sides of whole multiples, so that it need not change with each picture. */
const SIDE_PX = 32;

/**
 * Tiles put together at whole pixels of their level, to be seen scaled as one picture: no seam can show, since there is
 * none. A border of nothing around them keeps their outer edges as soft as inner ones.
 */
export class Sheet {
  readonly #context: CanvasRenderingContext2D;
  #held: Held | null = null;

  /** @throws DrawError when the browser has no 2D canvas */
  constructor() {
    this.#context = contextOf(document.createElement("canvas"));
  }

  get canvas(): HTMLCanvasElement {
    return this.#context.canvas;
  }

  /**
   * Puts together what is seen of the pieces and so many pixels `beyond`; does nothing while it holds what is seen.
   * @param smooth mixes colours between pixels; ids and the like are not to be mixed  @returns what the canvas holds, from its left top corner on; null: nothing is seen
   */
  lay(screen: Setting, grid: Grid, pieces: readonly Piece[], smooth: boolean, beyond: number): Window | null {
    const seen = windowOf(screen, grid, pieces, 0);
    if (!seen) return this.empty();
    if (this.#held && holds(this.#held, seen, grid, pieces, smooth)) return this.#held.window;
    const window = windowOf(screen, grid, pieces, beyond) as Window;
    const [x0, y0, x1, y1] = window;
    this.#room(x1 - x0, y1 - y0);
    this.#context.translate(-x0, -y0);
    this.#context.imageSmoothingEnabled = smooth;
    for (const piece of pieces) this.#lay(grid, piece);
    this.#held = { grid, smooth, window, pieces };
    return window;
  }

  /** What it held is gone. */
  forget(): void {
    this.#held = null;
  }

  /** Gives its memory back. */
  empty(): null {
    Object.assign(this.canvas, { width: 0, height: 0 });
    this.#held = null;
    return null;
  }

  /** Nothing, from the left top corner on. */
  #room(width: number, height: number): void {
    const { canvas } = this;
    const side = (is: number, need: number): number => (is < need || is > 2 * need ? Math.ceil(need / SIDE_PX) * SIDE_PX : is);
    const [w, h] = [side(canvas.width, width), side(canvas.height, height)];
    if (w !== canvas.width || h !== canvas.height) [canvas.width, canvas.height] = [w, h];
    this.#context.setTransform(1, 0, 0, 1, 0, 0);
    this.#context.clearRect(0, 0, w, h);
  }

  #lay(grid: Grid, { area, from, bitmap }: Piece): void {
    const [x0, y0, x1, y1] = placeOf(grid, area);
    if (from.z === area.z) this.#context.drawImage(bitmap, x0, y0, x1 - x0, y1 - y0);
    else this.#layPart(area, from, bitmap, [x0, y0, x1, y1]);
  }

  /** Part of an ancestor, with the pixels around it, so that what is beside it goes on smoothly. */
  #layPart(area: Tile, from: Tile, bitmap: ImageBitmap, [x0, y0, x1, y1]: readonly [number, number, number, number]): void {
    const context = this.#context;
    const parts = 2 ** (area.z - from.z);
    const side = bitmap.width / parts;
    const [u, v] = [(area.x - from.x * parts) * side, (area.y - from.y * parts) * side];
    const [left, top] = [Math.max(Math.floor(u) - 1, 0), Math.max(Math.floor(v) - 1, 0)];
    const [right, bottom] = [Math.min(Math.ceil(u + side) + 1, bitmap.width), Math.min(Math.ceil(v + side) + 1, bitmap.height)];
    const scale = (x1 - x0) / side;
    context.save();
    context.beginPath();
    context.rect(x0, y0, x1 - x0, y1 - y0);
    context.clip();
    context.drawImage(bitmap, left, top, right - left, bottom - top, x0 + (left - u) * scale, y0 + (top - v) * scale, (right - left) * scale, (bottom - top) * scale);
    context.restore();
  }
}

/** @throws DrawError when the canvas has another context already, or the browser no 2D canvas */
export function contextOf(canvas: HTMLCanvasElement): CanvasRenderingContext2D {
  const context = canvas.getContext("2d");
  if (!context) throw new DrawError("this browser offers neither WebGL2 nor a 2D canvas, of which the map needs one to draw; update it");
  return context;
}

/** What is seen of the pieces, so much beyond, and one pixel more; null: nothing. */
function windowOf({ width, height }: Pick<Setting, "width" | "height">, grid: Grid, pieces: readonly Piece[], beyond: number): Window | null {
  const { left, top, px } = grid;
  const places = pieces.map(({ area }) => placeOf(grid, area));
  const least = (k: number, edge: number): number => Math.max(Math.min(...places.map((place) => place[k] ?? 0)), Math.floor(edge) - beyond) - 1;
  const most = (k: number, edge: number): number => Math.min(Math.max(...places.map((place) => place[k] ?? 0)), Math.ceil(edge) + beyond) + 1;
  const window = [least(0, -left / px), least(1, -top / px), most(2, (width - left) / px), most(3, (height - top) / px)] as const;
  return window[2] > window[0] && window[3] > window[1] ? window : null;
}

/** Is all there that is seen, and as it is wanted? */
function holds({ grid, smooth, window, pieces }: Held, seen: Window, wanted: Grid, now: readonly Piece[], smoothNow: boolean): boolean {
  if (grid.level !== wanted.level || grid.tilePx !== wanted.tilePx || smooth !== smoothNow) return false;
  if (seen[0] < window[0] || seen[1] < window[1] || seen[2] > window[2] || seen[3] > window[3]) return false;
  const met = ({ area }: Piece): boolean => {
    const [x0, y0, x1, y1] = placeOf(wanted, area);
    return x0 < seen[2] && y0 < seen[3] && x1 > seen[0] && y1 > seen[1];
  };
  const there = new Map(pieces.filter(met).map((piece) => [pieceKey(piece), piece.bitmap]));
  const here = now.filter(met);
  return here.length === there.size && here.every((piece) => there.get(pieceKey(piece)) === piece.bitmap);
}

const pieceKey = ({ area, from }: Piece): string => [area.z, area.x, area.y, from.z].join("/");

import type { Tile } from "../../geo/frame";
import type { Stand } from "../../tiles/cover";
import type { Pass } from "../drawer";

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

/**
 * Tiles put together at whole pixels of their level, then drawn scaled as one picture: no seam can show, since there is
 * none. A border of nothing around them keeps their outer edges as soft as inner ones.
 */
export class Sheet {
  readonly #context: CanvasRenderingContext2D;

  constructor() {
    this.#context = document.createElement("canvas").getContext("2d") as CanvasRenderingContext2D;
  }

  /** @param smooth mixes colours between pixels; ids and the like are not to be mixed */
  show(screen: CanvasRenderingContext2D, grid: Grid, pieces: readonly Piece[], smooth: boolean, opacity: number): void {
    const { canvas } = this.#context;
    const [x0, y0, x1, y1] = this.#window(screen.canvas, grid, pieces);
    if (x1 <= x0 || y1 <= y0) return;
    const [width, height] = [x1 - x0, y1 - y0];
    if (canvas.width < width) canvas.width = width;
    if (canvas.height < height) canvas.height = height;
    this.#context.setTransform(1, 0, 0, 1, 0, 0);
    this.#context.clearRect(0, 0, canvas.width, canvas.height);
    this.#context.translate(-x0, -y0);
    this.#context.imageSmoothingEnabled = smooth;
    for (const piece of pieces) this.#lay(grid, piece);
    const { left, top, px } = grid;
    screen.imageSmoothingEnabled = smooth && px !== 1;
    screen.globalAlpha = opacity;
    screen.drawImage(canvas, 0, 0, width, height, left + x0 * px, top + y0 * px, width * px, height * px);
    screen.globalAlpha = 1;
  }

  /** Gives its memory back. */
  empty(): void {
    Object.assign(this.#context.canvas, { width: 0, height: 0 });
  }

  /** What is seen of the pieces and one pixel more, in pixels of the level. */
  #window({ width, height }: HTMLCanvasElement, grid: Grid, pieces: readonly Piece[]): [number, number, number, number] {
    const { left, top, px } = grid;
    const places = pieces.map(({ area }) => placeOf(grid, area));
    const least = (k: number, edge: number): number => Math.max(Math.min(...places.map((place) => place[k] ?? 0)), Math.floor(edge)) - 1;
    const most = (k: number, edge: number): number => Math.min(Math.max(...places.map((place) => place[k] ?? 0)), Math.ceil(edge)) + 1;
    return [least(0, -left / px), least(1, -top / px), most(2, (width - left) / px), most(3, (height - top) / px)];
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


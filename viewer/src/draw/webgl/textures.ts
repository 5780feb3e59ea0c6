import type { TileData } from "../../tiles/tileData";

/** Texels around a tile that hold its neighbours' pixels: one for filtering, one for light spread at edges. */
export const GUTTER = 2;

/** A tile on the GPU, with its gutter. */
export interface TileTexture {
  readonly texture: WebGLTexture;
  readonly width: number;
  readonly height: number;
  /** Source of each part of the gutter, at (dx + 1) + 3 (dy + 1): 0 not filled, 3 from the tile there. */
  readonly filled: number[];
}

/** Returns the key of the same layer's tile dx columns to the right and dy rows down. */
export type Neighbour = (dx: number, dy: number) => string;

/** Tile textures by key. */
export class TileTextures {
  readonly #gl: WebGL2RenderingContext;
  readonly #known = new Map<string, TileTexture>();
  readonly #reader: WebGLFramebuffer;

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.#reader = gl.createFramebuffer();
  }

  get(key: string): TileTexture | undefined {
    return this.#known.get(key);
  }

  /** Uploads a tile and exchanges edge pixels with its loaded neighbours. */
  upload(key: string, data: TileData, neighbour: Neighbour): TileTexture {
    const tile = this.#create(data);
    this.#known.set(key, tile);
    for (const [dx, dy] of NEIGHBOURS) {
      const other = this.#known.get(neighbour(dx, dy));
      if (!other || other.width !== tile.width || other.height !== tile.height) continue;
      this.#copyEdge(other, tile, dx, dy);
      this.#copyEdge(tile, other, -dx, -dy);
    }
    return tile;
  }

  release(key: string): void {
    const tile = this.#known.get(key);
    if (!tile) return;
    this.#known.delete(key);
    this.#gl.deleteTexture(tile.texture);
  }

  clear(): void {
    for (const key of [...this.#known.keys()]) this.release(key);
    this.#gl.deleteFramebuffer(this.#reader);
  }

  #create(data: TileData): TileTexture {
    const gl = this.#gl;
    const { width, height } = data;
    const texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0 + SPARE_UNIT);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    const filter = data.kind === "color" || data.kind === "picture" ? gl.LINEAR : gl.NEAREST;
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    const [stored] = this.#formatOf(data.kind);
    gl.texStorage2D(gl.TEXTURE_2D, 1, stored, width + 2 * GUTTER, height + 2 * GUTTER);
    this.#fill(data);
    return { texture, width, height, filled: new Array<number>(9).fill(0) };
  }

  #fill(data: TileData): void {
    const gl = this.#gl;
    const { width, height } = data;
    const [, format, type] = this.#formatOf(data.kind);
    // Custom layers may have changed these.
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    if ("bitmap" in data) gl.texSubImage2D(gl.TEXTURE_2D, 0, GUTTER, GUTTER, format, type, data.bitmap);
    else gl.texSubImage2D(gl.TEXTURE_2D, 0, GUTTER, GUTTER, width, height, format, type, data.values);
  }

  /** Returns the internal format, and the format and type of the upload. */
  #formatOf(kind: TileData["kind"]): [stored: number, format: number, type: number] {
    const gl = this.#gl;
    switch (kind) {
      case "color":
      case "picture":
        return [gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE];
      case "normal":
        return [gl.RGB8, gl.RGB, gl.UNSIGNED_BYTE];
      case "sun":
      case "ao":
        return [gl.R8, gl.RED, gl.UNSIGNED_BYTE];
      case "sun16":
        return [gl.R16UI, gl.RED_INTEGER, gl.UNSIGNED_SHORT];
      default:
        return [gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT];
    }
  }

  /** Fills `to`'s gutter towards (dx, dy) with the nearest pixels of `from`, the tile there. */
  #copyEdge(from: TileTexture, to: TileTexture, dx: number, dy: number): void {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#reader);
    gl.framebufferTexture2D(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, from.texture, 0);
    gl.activeTexture(gl.TEXTURE0 + SPARE_UNIT);
    gl.bindTexture(gl.TEXTURE_2D, to.texture);
    const [toX, fromX, w] = edgeSpan(dx, to.width);
    const [toY, fromY, h] = edgeSpan(dy, to.height);
    gl.copyTexSubImage2D(gl.TEXTURE_2D, 0, toX, toY, fromX, fromY, w, h);
    to.filled[gutterIndex(dx, dy)] = FROM_NEIGHBOUR;
    if (dx === 0 || dy === 0) this.#copyCorners(to, dx, dy, fromX, fromY);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
  }

  /** Fills a corner from the tile above or below, or else from the one at the side, until the diagonal tile is loaded. */
  #copyCorners(to: TileTexture, dx: number, dy: number, fromX: number, fromY: number): void {
    const quality = dx === 0 ? 2 : 1;
    for (const end of [-1, 1]) {
      const [cx, cy] = dx === 0 ? [end, dy] : [dx, end];
      if ((to.filled[gutterIndex(cx, cy)] ?? 0) >= quality) continue;
      to.filled[gutterIndex(cx, cy)] = quality;
      const [toX] = edgeSpan(cx, to.width);
      const [toY] = edgeSpan(cy, to.height);
      const sourceX = dx === 0 ? (end < 0 ? GUTTER : to.width) : fromX;
      const sourceY = dy === 0 ? (end < 0 ? GUTTER : to.height) : fromY;
      this.#gl.copyTexSubImage2D(this.#gl.TEXTURE_2D, 0, toX, toY, sourceX, sourceY, GUTTER, GUTTER);
    }
  }
}

const FROM_NEIGHBOUR = 3;

/** A texture unit that no sampler uses. */
export const SPARE_UNIT = 9;

const NEIGHBOURS = [-1, 0, 1].flatMap((dy) => [-1, 0, 1].map((dx) => [dx, dy] as const)).filter(([dx, dy]) => dx !== 0 || dy !== 0);

const gutterIndex = (dx: number, dy: number): number => dx + 1 + 3 * (dy + 1);

/** Returns the first texel to write, the first to read in the other tile, and their number, along one axis. */
function edgeSpan(step: number, size: number): [number, number, number] {
  if (step < 0) return [0, size, GUTTER];
  if (step > 0) return [size + GUTTER, GUTTER, GUTTER];
  return [GUTTER, GUTTER, size];
}

/**
 * Computes the texels that may be read in all of a tile's textures, including the filled gutter: min x, min y, max x, max y; −1 and size are
 * the first texels of the gutter.
 */
export function computeReadableBounds(textures: readonly TileTexture[]): [number, number, number, number] {
  const { width = 0, height = 0 } = textures[0] ?? {};
  const more = (place: number): number => (textures.every(({ filled }) => filled[place]) ? GUTTER : 0);
  return [-more(3), -more(1), width - 1 + more(5), height - 1 + more(7)];
}

import { NO_DEPTH } from "../../tiles/tileData";
import type { Tile } from "../../geo/frame";
import { computeCorner, computeDepthAtZero, type DepthMapping } from "../depthMapping";

/** A tile of another layer that may hide pixels of this one. */
export interface Mask {
  /** Name of its depths. */
  readonly depth: string;
  /** Name of the colours whose alpha says what is covered all; null: all that has a depth is. */
  readonly color: string | null;
  /** Its pixel at the middle of the first pixel here, and its pixels a pixel here. */
  readonly x: number;
  readonly y: number;
  readonly step: number;
  /** What is here is hidden where `value · unit + first` is more than the other's `value`. */
  readonly unit: number;
  readonly first: number;
}

/** Where a tile of another layer lies on one of this; null when they do not meet. */
export function makeMask(own: DepthMapping, tile: Tile, other: DepthMapping, above: Tile, names: Pick<Mask, "depth" | "color">): Mask | null {
  const [[u, v, px], [otherU, otherV, otherPx]] = [computeCorner(own, tile), computeCorner(other, above)];
  const [side, otherSide] = [own.frame.tilePx * px, other.frame.tilePx * otherPx];
  if (u + side <= otherU || otherU + otherSide <= u || v - side >= otherV || otherV - otherSide >= v) return null;
  const step = px / otherPx;
  const at = (from: number): number => from / otherPx + step / 2;
  return { ...names, x: at(u - otherU), y: at(otherV - v), step, unit: own.unit_m / other.unit_m, first: (computeDepthAtZero(own) - computeDepthAtZero(other)) / other.unit_m };
}

/** A tile that masks, as the worker has it; rows from the top. */
export interface MaskLayers {
  readonly mask: Mask;
  readonly width: number;
  readonly height: number;
  readonly depth: Uint32Array;
  /** RGBA */
  readonly color: Uint8ClampedArray | undefined;
}

/** Calls for each pixel that something of another layer hides. A pixel that is covered in part but has no depth takes that of the nearest beside it. */
export function forEachHidden(width: number, height: number, depth: Uint32Array, masks: readonly MaskLayers[], act: (at: number) => void): void {
  const nearest = makeDepthReader(width, depth);
  for (const { mask, depth: other, color, ...size } of masks) {
    for (let j = 0; j < height; j++) {
      const y = Math.floor(mask.y + j * mask.step);
      if (y < 0 || y >= size.height) continue;
      for (let i = 0; i < width; i++) {
        const x = Math.floor(mask.x + i * mask.step);
        if (x < 0 || x >= size.width) continue;
        const [from, at] = [y * size.width + x, j * width + i];
        const there = other[from] as number;
        if (there === NO_DEPTH || (color && (color[4 * from + 3] as number) < 255)) continue;
        if (nearest(at) * mask.unit + mask.first > there) act(at);
      }
    }
  }
}

function makeDepthReader(width: number, depth: Uint32Array): (at: number) => number {
  const steps = [-1, 1, -width, width, -width - 1, -width + 1, width - 1, width + 1];
  return (at) => {
    const own = depth[at] as number;
    return own !== NO_DEPTH ? own : Math.min(...steps.map((step) => depth[at + step] ?? NO_DEPTH));
  };
}

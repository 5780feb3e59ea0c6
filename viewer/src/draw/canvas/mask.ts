import { NO_DEPTH } from "../../tiles/tileData";
import type { Tile } from "../../geo/frame";
import { computeCorner, computeDepthAtZero, type DepthMapping } from "../depthMapping";

/** A tile of another layer that may hide pixels of a tile. */
export interface Mask {
  /** Name of its depths in the worker. */
  readonly depth: string;
  /** Name of its colours, whose alpha tells fully covered pixels; null: all pixels with a depth are. */
  readonly color: string | null;
  /** Its pixel at the centre of the tile's first pixel, and its pixels per pixel of the tile. */
  readonly x: number;
  readonly y: number;
  readonly step: number;
  /** A pixel is hidden where `value · unit + first` is greater than the mask's value. */
  readonly unit: number;
  readonly first: number;
}

/** Computes how a tile of another layer overlaps a tile; null when it does not. */
export function makeMask(
  own: DepthMapping,
  tile: Tile,
  other: DepthMapping,
  above: Tile,
  names: Pick<Mask, "depth" | "color">,
): Mask | null {
  const [[u, v, px], [otherU, otherV, otherPx]] = [computeCorner(own, tile), computeCorner(other, above)];
  const [side, otherSide] = [own.frame.tilePx * px, other.frame.tilePx * otherPx];
  if (u + side <= otherU || otherU + otherSide <= u || v - side >= otherV || otherV - otherSide >= v) return null;
  const step = px / otherPx;
  const at = (from: number): number => from / otherPx + step / 2;
  return {
    ...names,
    x: at(u - otherU),
    y: at(otherV - v),
    step,
    unit: own.unit_m / other.unit_m,
    first: (computeDepthAtZero(own) - computeDepthAtZero(other)) / other.unit_m,
  };
}

/** The layers of a mask in the worker; rows from the top. */
export interface MaskLayers {
  readonly mask: Mask;
  readonly width: number;
  readonly height: number;
  readonly depth: Uint32Array;
  /** RGBA */
  readonly color: Uint8ClampedArray | undefined;
}

/** Calls `act` for each pixel hidden by another layer. A partly covered pixel without a depth takes the least depth around it. */
export function forEachHidden(
  width: number,
  height: number,
  depth: Uint32Array,
  masks: readonly MaskLayers[],
  act: (at: number) => void,
): void {
  const depthAt = makeDepthReader(width, depth);
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
        if (depthAt(at) * mask.unit + mask.first > there) act(at);
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

import type { TileLight } from "./shadingOptions";

/** The layers of a tile that light it, all of the same size. */
export interface LightLayers {
  /** RGB8 */
  readonly normal: Uint8Array;
  readonly ao?: Uint8Array | undefined;
  /** Fraction of sunlight, or one bit per sun. */
  readonly shadow?: Uint8Array | Uint16Array | undefined;
}

/**
 * Computes the fractions of skylight and sunlight on each pixel of a tile, in pairs: half from the pixel's own normal, occlusion and shadow, an eighth from each
 * neighbour's, like the shader (draw/webgl/shader.ts explains why). Where a neighbouring tile is missing, uses the pixel's own light.
 * @param neighbours tiles to the left, to the right, above and below  @returns a buffer that is valid until the next call
 */
export function computeTileLight(
  light: TileLight,
  width: number,
  height: number,
  layers: LightLayers,
  neighbours: readonly (LightLayers | undefined)[],
): Float32Array {
  const wide = width + 2;
  const own = (buffers[0] = resizeBuffer(buffers[0], 2 * wide * (height + 2))).fill(NONE);
  const row = makeRowLighter(light, own);
  for (let y = 0; y < height; y++) row(layers, y * width, 1, wide * (y + 1) + 1, 1, width);
  const [left, right, above, below] = neighbours;
  if (left) row(left, width - 1, width, wide, wide, height);
  if (right) row(right, 0, width, 2 * wide - 1, wide, height);
  if (above) row(above, (height - 1) * width, 1, 1, 1, width);
  if (below) row(below, 0, 1, wide * (height + 1) + 1, 1, width);
  return spreadLight(own, width, height);
}

/** Reused for each tile: a worker collects garbage late. */
const buffers = [new Float32Array(0), new Float32Array(0)] as [Float32Array, Float32Array];

const resizeBuffer = (buffer: Float32Array, length: number): Float32Array => (buffer.length === length ? buffer : new Float32Array(length));

/** Light of pixels without a normal. */
const NONE = -1;
/** Fraction of sunlight on pixels without a normal. */
const UNKNOWN = 0.5;

type RowLighter = (layers: LightLayers, from: number, step: number, to: number, stride: number, count: number) => void;

/** Returns a function that applies Lambert's law to a row or column of normals; computes runs of equal normals once. */
function makeRowLighter({ sun, shadow: suns }: TileLight, out: Float32Array): RowLighter {
  let [last, cosine] = [0, NONE];
  return ({ normal, ao, shadow }, from, step, to, stride, count) => {
    for (let k = 0, p = from; k < count; k++, p += step, to += stride) {
      const [r, g, b] = [normal[3 * p] as number, normal[3 * p + 1] as number, normal[3 * p + 2] as number];
      const word = r | (g << 8) | (b << 16);
      if (word !== last) {
        const [x, y, z] = [2 * r - 255, 2 * g - 255, 2 * b - 255];
        cosine = word === 0 ? NONE : Math.max(0, (x * sun[0] + y * sun[1] + z * sun[2]) / Math.sqrt(x * x + y * y + z * z));
        last = word;
      }
      if (cosine < 0) continue;
      out[2 * to] = ao ? (ao[p] as number) / 255 : 1;
      out[2 * to + 1] = shadow && suns ? cosine * computeSunShare(suns, shadow[p] as number) : cosine;
    }
  };
}

function computeSunShare({ kind, first, second, share }: NonNullable<TileLight["shadow"]>, value: number): number {
  return kind === "sun" ? value / 255 : ((value >> first) & 1) * (1 - share) + ((value >> second) & 1) * share;
}

/** Spreads light to neighbouring pixels. @param own light with a border of one pixel */
function spreadLight(own: Float32Array, width: number, height: number): Float32Array {
  const row = 2 * (width + 2);
  const out = (buffers[1] = resizeBuffer(buffers[1], 2 * width * height));
  const or = (at: number, k: number, instead: number): number => ((own[at] as number) < 0 ? instead : (own[at + k] as number));
  for (let y = 0, to = 0; y < height; y++) {
    for (let x = 0, at = row * (y + 1) + 2; x < width; x++, at += 2, to += 2) {
      if ((own[at] as number) < 0) {
        [out[to], out[to + 1]] = [1, UNKNOWN];
        continue;
      }
      for (let k = 0; k < 2; k++) {
        const mine = own[at + k] as number;
        out[to + k] = 0.5 * mine + 0.125 * (or(at - 2, k, mine) + or(at + 2, k, mine) + or(at - row, k, mine) + or(at + row, k, mine));
      }
    }
  }
  return out;
}

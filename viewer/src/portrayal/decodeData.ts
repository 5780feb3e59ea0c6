import { DecodeError } from "../core/errors";
import { decodePng, type DecodedPng } from "../core/png";
import type { TileData } from "../map3d";

/** A message to the worker. */
export interface DataRequest {
  readonly id: number;
  readonly kind: "normal" | "id" | "depth";
  readonly bytes: ArrayBuffer;
  /** Is x in R, not in B? Only for normals. */
  readonly rgbOrder: boolean;
  /** Depths from here on are no surface, metres. */
  readonly far_m: number;
}

export type DataResponse = { readonly id: number; readonly data: TileData } | { readonly id: number; readonly error: string };

/** Unit of decoded depths: spec/pyramid.md §6. */
export const DEPTH_UNIT_M = 2 ** -10;
/** No surface: spec/pyramid.md §5. */
const NO_DEPTH = 0xffffffff;

/** Decodes an image in the encodings of OGC 15-001r4 Table 35 to the values of spec/pyramid.md §6. @throws DecodeError */
export async function decodeData({ kind, bytes, rgbOrder, far_m }: Omit<DataRequest, "id">): Promise<TileData> {
  const png = await decodePng(new Uint8Array(bytes));
  const { width, height } = png;
  if (png.channels < 3) throw new DecodeError(`${kind}: expected 24 or 32 bits per pixel, got ${String(8 * png.channels)}`);
  if (kind === "normal") return { kind, width, height, values: readNormals(png, rgbOrder) };
  if (kind === "id") return { kind, width, height, values: readIds(png) };
  if (png.channels !== 4) throw new DecodeError(`depth: expected floats of 32 bits per pixel, got ${String(8 * png.channels)} bits`);
  return { kind, width, height, values: readDepths(png, far_m) };
}

/** Returns x, y, z of each pixel; zeros without a surface. */
function readNormals({ channels, data }: DecodedPng, rgbOrder: boolean): Uint8Array<ArrayBuffer> {
  const [x, z] = rgbOrder ? [0, 2] : [2, 0];
  const values = new Uint8Array((data.length / channels) * 3);
  for (let from = 0, to = 0; from < data.length; from += channels, to += 3) {
    if (channels === 4 && data[from + 3] === 0) continue;
    values[to] = data[from + x] as number;
    values[to + 1] = data[from + 1] as number;
    values[to + 2] = data[from + z] as number;
  }
  return values;
}

/** Returns A·2²⁴ + B·2¹⁶ + G·2⁸ + R of each pixel. */
function readIds({ channels, data }: DecodedPng): Uint32Array<ArrayBuffer> {
  const values = new Uint32Array(data.length / channels);
  for (let k = 0, at = 0; k < values.length; k++, at += channels) {
    values[k] =
      ((data[at] as number) |
        ((data[at + 1] as number) << 8) |
        ((data[at + 2] as number) << 16) |
        ((channels === 4 ? (data[at + 3] as number) : 0) << 24)) >>>
      0;
  }
  return values;
}

/** Returns the depths, of floats in metres in A, B, G, R. Infinite, negative and zero depths, and those at the far plane, are no surface. */
function readDepths({ data }: DecodedPng, far_m: number): Uint32Array<ArrayBuffer> {
  const floats = new Float32Array(data.buffer, data.byteOffset, data.byteLength / 4);
  const far = far_m * (1 - 1e-6);
  return Uint32Array.from(floats, (metres) =>
    metres > 0 && metres < far ? Math.min(Math.round(metres / DEPTH_UNIT_M), NO_DEPTH - 1) : NO_DEPTH,
  );
}

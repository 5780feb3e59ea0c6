import { DecodeError } from "../core/errors";
import { decodePng, type Pixels } from "./png";

/** A decoded tile. Rows from the top. */
export type TileData =
  | { readonly kind: "color"; readonly width: number; readonly height: number; readonly bitmap: ImageBitmap }
  /** values: RGB8 as stored */
  | { readonly kind: "normal"; readonly width: number; readonly height: number; readonly values: Uint8Array<ArrayBuffer> }
  /** values: one uint32 a pixel */
  | { readonly kind: "id" | "depth"; readonly width: number; readonly height: number; readonly values: Uint32Array<ArrayBuffer> };

export const NO_DEPTH = 0xffffffff;

/** @throws DecodeError */
export async function decodeTile(kind: string, mediaType: string, bytes: ArrayBuffer): Promise<TileData> {
  if (kind === "color") return decodeColor(mediaType, bytes);
  const pixels = await decodePng(new Uint8Array(bytes));
  const channels = kind === "normal" ? 3 : 4;
  if (pixels.channels !== channels) throw new DecodeError(`a ${kind} tile has ${String(channels)} bytes a pixel, got ${String(pixels.channels)}`);
  const { width, height } = pixels;
  if (kind === "normal") return { kind, width, height, values: pixels.data };
  if (kind === "id" || kind === "depth") return { kind, width, height, values: uint32s(pixels) };
  throw new DecodeError(`layers of kind "${kind}" are unknown to this viewer`);
}

export function transferable(data: TileData): Transferable {
  return data.kind === "color" ? data.bitmap : data.values.buffer;
}

export const bytesOf = (data: TileData): number => data.width * data.height * (data.kind === "normal" ? 3 : 4);

/** Little-endian in R, G, B, A, which is how memory is read on every machine that runs a browser. */
function uint32s({ data }: Pixels): Uint32Array<ArrayBuffer> {
  return new Uint32Array(data.buffer, data.byteOffset, data.byteLength / 4);
}

async function decodeColor(mediaType: string, bytes: ArrayBuffer): Promise<TileData> {
  const blob = new Blob([bytes], { type: mediaType });
  try {
    const bitmap = await createImageBitmap(blob, { premultiplyAlpha: "none", colorSpaceConversion: "none" });
    return { kind: "color", width: bitmap.width, height: bitmap.height, bitmap };
  } catch (reason) {
    throw new DecodeError(`the browser cannot decode a ${mediaType} tile of ${String(bytes.byteLength)} bytes: ${String(reason)}`);
  }
}

import { DecodeError } from "../core/errors";
import { decodeDataTile, type DataKind } from "../core/dataTile";
import { decodePng } from "../core/png";
import type { Tile } from "../geo/frame";
import { enlargeQuarter, type EnlargedData } from "./enlargeQuarter";

/** A decoded tile; rows from the top. */
export type TileData =
  | { readonly kind: "color" | "picture"; readonly width: number; readonly height: number; readonly bitmap: ImageBitmap }
  /** Values: RGB8 as stored. */
  | { readonly kind: "normal"; readonly width: number; readonly height: number; readonly values: Uint8Array<ArrayBuffer> }
  /** Values: one uint32 per pixel. */
  | { readonly kind: "id" | "depth" | "depth2"; readonly width: number; readonly height: number; readonly values: Uint32Array<ArrayBuffer> }
  /** Values: share of light, 255 for full light. */
  | { readonly kind: "sun" | "ao"; readonly width: number; readonly height: number; readonly values: Uint8Array<ArrayBuffer> }
  /** Values: one bit per sun. */
  | { readonly kind: "sun16"; readonly width: number; readonly height: number; readonly values: Uint16Array<ArrayBuffer> };

/** Bytes per pixel in the PNG of each kind of layer (spec/layers.json); 0 for pictures that the browser decodes. */
export const CHANNELS = { color: 0, picture: 0, normal: 3, id: 4, depth: 4, depth2: 4, sun: 1, ao: 1, sun16: 2 } as const;

/** What a layer shows: spec/pyramid.md §6. */
export type LayerKind = keyof typeof CHANNELS;

export const NO_DEPTH = 0xffffffff;

/** Media type of a tile with normals, ids and depths. */
export const DATA_TYPE = "application/vnd.map3d.data";

/** Decodes a tile, or the pixels of one kind from a data tile. @param below the bytes are those of the tile of light above this one  @throws DecodeError */
export async function decodeTile(kind: string, mediaType: string, bytes: ArrayBuffer, below?: Tile): Promise<TileData> {
  const data = await decodeWhole(kind, mediaType, bytes);
  return below ? enlargeQuarter(data as EnlargedData, below) : data;
}

async function decodeWhole(kind: string, mediaType: string, bytes: ArrayBuffer): Promise<TileData> {
  if (!isKind(kind)) throw new DecodeError(`unknown layer kind "${kind}"`);
  if (!CHANNELS[kind]) return decodeColor(kind as "color" | "picture", mediaType, bytes);
  if (mediaType === DATA_TYPE) return (await decodeDataTile(new Uint8Array(bytes), kind as DataKind)) as TileData;
  const { width, height, channels, data } = await decodePng(new Uint8Array(bytes));
  if (channels !== CHANNELS[kind])
    throw new DecodeError(`${kind} tiles have ${String(CHANNELS[kind])} bytes per pixel, got ${String(channels)}`);
  // The values are little-endian, as memory is on every machine that runs a browser.
  const { buffer, byteOffset, byteLength } = data;
  const values =
    channels > 3
      ? new Uint32Array(buffer, byteOffset, byteLength / 4)
      : channels === 2
        ? new Uint16Array(buffer, byteOffset, byteLength / 2)
        : data;
  return { kind, width, height, values } as TileData;
}

const isKind = (kind: string): kind is LayerKind => Object.hasOwn(CHANNELS, kind);

/**
 * Lists the parts of a tile to transfer to another thread. Bitmaps are copied: WebKitGTK 2.50 uploads nothing to WebGL from a transferred one.
 */
export function listTransferables(data: TileData): Transferable[] {
  return "bitmap" in data ? [] : [data.values.buffer];
}

export const computeBytes = (data: TileData): number => data.width * data.height * (CHANNELS[data.kind] || 4);

async function decodeColor(kind: "color" | "picture", mediaType: string, bytes: ArrayBuffer): Promise<TileData> {
  const blob = new Blob([bytes], { type: mediaType });
  try {
    const bitmap = await createImageBitmap(blob, { premultiplyAlpha: "none", colorSpaceConversion: "none" });
    return { kind, width: bitmap.width, height: bitmap.height, bitmap };
  } catch (reason) {
    throw new DecodeError(`cannot decode a ${mediaType} tile of ${String(bytes.byteLength)} bytes: ${String(reason)}`);
  }
}

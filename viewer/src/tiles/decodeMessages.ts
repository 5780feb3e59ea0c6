import type { Tile } from "../geo/frame";
import type { TileData } from "./tileData";

export interface DecodeRequest {
  readonly id: number;
  readonly kind: string;
  readonly mediaType: string;
  readonly bytes: ArrayBuffer;
  /** Bytes of light are those of the tile above this one. */
  readonly below: Tile | undefined;
}

export type DecodeResponse = { readonly id: number; readonly data: TileData } | { readonly id: number; readonly error: string };

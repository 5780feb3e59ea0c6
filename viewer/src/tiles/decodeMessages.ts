import type { TileData } from "./tileData";

export interface DecodeRequest {
  readonly id: number;
  readonly kind: string;
  readonly mediaType: string;
  readonly bytes: ArrayBuffer;
}

export type DecodeResponse = { readonly id: number; readonly data: TileData } | { readonly id: number; readonly error: string };

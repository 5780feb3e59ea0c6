import type { LayerKind, TileData } from "../../tiles/tileData";
import type { Rgb } from "../color";
import type { DrawStyles } from "../drawStyle";
import type { ShadingOptions } from "./shadingOptions";

/** A shaded tile: pixels, or a bitmap where the browser does not allow exact readback. */
export type TileImage = ImageData | ImageBitmap;

/** A value that the worker stores under a name: one layer of a tile, highlight colours by id, or styles. */
export type WorkerValue = TileData | ReadonlyMap<number, Rgb> | DrawStyles;

/** Asks for a shaded tile; its layers are given by name. */
export interface ShadeRequest {
  readonly ticket: number;
  readonly options: ShadingOptions;
  readonly layers: Partial<Record<LayerKind, string>>;
  /** Layers of the tiles to the left, to the right, above and below. */
  readonly neighbours: Partial<Record<LayerKind, readonly string[]>>;
}

export type ShadeMessage = { readonly put: string; readonly value: WorkerValue } | { readonly drop: string } | ShadeRequest;

export type ShadeResponse = { readonly ticket: number; readonly picture: TileImage } | { readonly ticket: number; readonly error: string };

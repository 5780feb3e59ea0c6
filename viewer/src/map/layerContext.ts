import type { Vec3 } from "../core/vec";
import type { Camera } from "../geo/camera";
import type { Rendering } from "../geo/manifest";
import type { TileResources } from "../tiles/layerTiles";

/** What an image layer gets from the map it is on. */
export interface LayerContext {
  readonly tileResources: TileResources;
  /** A name for the layer's tiles that no other layer of the map has. */
  createName(): string;
  /** A layer has left: its tiles can go. */
  dropTiles(layer: string): void;
  /** @throws UsageError when a manifest does not go with what is on the map */
  checkCompatible(rendering: Rendering): void;
  /** The layer's manifest is here. */
  onManifest(rendering: Rendering): void;
  /** A frame is needed. */
  requestFrame(): void;
  report(error: Error): void;
}

/** The camera, and the origin (world) that its U and V refer to. */
export interface ViewState {
  readonly camera: Camera;
  readonly origin: Vec3;
  readonly dpr: number;
  /** Levels by which tiles are finer than is usual for the pixels; negative: coarser. */
  readonly finer: number;
}

import type { LayerHost } from "../core/mapLayer";
import type { Vec3 } from "../core/vec";
import type { Camera } from "../geo/camera";
import type { Rendering } from "../geo/manifest";
import type { TileResources } from "../tiles/layerTiles";

/** The services of a map for its image layers. */
export interface LayerContext {
  readonly tileResources: TileResources;
  /** Returns a name for the layer's tiles, unique on the map. */
  createName(): string;
  /** Drops the tiles of a removed layer. */
  dropTiles(layer: string): void;
  /** @throws UsageError when a rendering cannot be combined with those on the map */
  checkCompatible(rendering: Rendering): void;
  /** Called when the layer's manifest has loaded. */
  onManifest(rendering: Rendering): void;
  requestFrame(): void;
  report(error: Error): void;
}

/** A map as seen by its image layers. */
export interface ImageLayerHost extends LayerHost<ImageLayerHost> {
  /** undefined when the map cannot draw. */
  readonly layerContext: LayerContext | undefined;
  readonly overlayPane: HTMLElement;
}

/** The camera with the origin of its U and V, and the screen's resolution. */
export interface ViewState {
  readonly camera: Camera;
  /** World coordinates. */
  readonly origin: Vec3;
  /** Device pixels per CSS pixel. */
  readonly dpr: number;
  /** Levels by which tiles are finer than the pixels call for; negative: coarser. */
  readonly finer: number;
}

import { asError, DecodeError, FetchError } from "../core/errors";
import { tileName, type Tile } from "../geo/frame";
import type { LayerInfo, View } from "../geo/manifest";
import type { Cache } from "./cache";
import type { Decoder } from "./decoder";
import type { TileRequest, RequestQueue } from "./queue";
import type { Source } from "./source";
import { computeBytes, type TileData } from "./tileData";

/** A tile in memory. `data` is null when the tile is empty, or when only the drawer has it. */
export interface CachedTile {
  data: TileData | null;
  readonly empty: boolean;
  /** Bytes received, and when (performance.now). */
  readonly transfer: { readonly bytes: number; readonly at_ms: number };
}

export interface TileResources {
  readonly cache: Cache<CachedTile>;
  readonly queue: RequestQueue;
  readonly decoder: Decoder;
}

const RETRY_AFTER_MS = 15_000;

/** Fetches, decodes and keeps the tiles of one image layer. */
export class LayerTiles {
  readonly #name: string;
  readonly #source: Source;
  readonly #resources: TileResources;
  readonly #failed = new Map<string, { readonly at_ms: number; readonly error: Error }>();
  readonly #onArrival: (error: Error | null) => void;

  /** @param name unique on the map  @param onArrival called after each tile, with the error if it failed */
  constructor(name: string, source: Source, resources: TileResources, onArrival: (error: Error | null) => void) {
    this.#name = name;
    this.#source = source;
    this.#resources = resources;
    this.#onArrival = onArrival;
  }

  key(view: View, layer: LayerInfo, tile: Tile): string {
    return `${this.#name}/${view.id}/${layer.name}/${tileName(tile)}`;
  }

  /** Returns a tile in memory and counts it as used. */
  get(view: View, layer: LayerInfo, tile: Tile): CachedTile | undefined {
    return this.#resources.cache.get(this.key(view, layer, tile));
  }

  /** Returns a tile's transfer without counting it as used. */
  getTransfer(view: View, layer: LayerInfo, tile: Tile): CachedTile["transfer"] | undefined {
    return this.#resources.cache.peek(this.key(view, layer, tile))?.transfer;
  }

  /** Releases the data of a tile that the drawer has copied. Ids and depths must be kept for picking. */
  releaseData(view: View, layer: LayerInfo | undefined, tile: Tile): void {
    const loaded = layer && this.get(view, layer, tile);
    if (!loaded) return;
    if (loaded.data && "bitmap" in loaded.data) loaded.data.bitmap.close();
    loaded.data = null;
  }

  /** Whether fetching a tile failed a short time ago. */
  hasFailed(view: View, layer: LayerInfo, tile: Tile): boolean {
    const failure = this.#failed.get(this.key(view, layer, tile));
    return failure !== undefined && performance.now() - failure.at_ms < RETRY_AFTER_MS;
  }

  /** Forgets failures, so that their tiles are requested again. */
  clearFailures(): void {
    this.#failed.clear();
  }

  makeRequest(view: View, layer: LayerInfo, tile: Tile): TileRequest {
    const key = this.key(view, layer, tile);
    return { key, run: (signal) => this.#load(key, view, layer, tile, signal) };
  }

  /** Returns a decoded tile, fetched if it is not in memory; null when it is empty. @throws the error of the fetch */
  async fetch(view: View, layer: LayerInfo, tile: Tile): Promise<TileData | null> {
    if (!view.occupancy.has(tile)) return null;
    const cached = this.get(view, layer, tile);
    if (cached && (cached.data || cached.empty)) return cached.data;
    await this.#resources.queue.runNow(this.makeRequest(view, layer, tile));
    const loaded = this.get(view, layer, tile);
    if (!loaded) throw this.#failed.get(this.key(view, layer, tile))?.error ?? new FetchError(`${this.key(view, layer, tile)}: the request was aborted`);
    return loaded.data;
  }

  async #load(key: string, view: View, layer: LayerInfo, tile: Tile, signal: AbortSignal): Promise<void> {
    try {
      const bytes = await this.#source.tile(view, layer, tile, signal);
      const transfer = { bytes: bytes?.byteLength ?? 0, at_ms: performance.now() }; // the bytes move to another thread
      const data = bytes && (await this.#resources.decoder.decode(layer.kind, layer.media_type, bytes));
      if (signal.aborted) {
        if (data && "bitmap" in data) data.bitmap.close();
        return;
      }
      this.#resources.cache.set(key, { data, empty: !data, transfer }, data ? computeBytes(data) * (data.kind === "id" || data.kind === "depth" ? 2 : 1) : 64);
      this.#failed.delete(key);
      this.#onArrival(null);
    } catch (reason) {
      if (signal.aborted) return;
      const name = `tile ${view.id}/${layer.name}/${tileName(tile)}`;
      const error = reason instanceof DecodeError ? new DecodeError(`${name}: ${reason.message}`) : asError(reason);
      this.#failed.set(key, { at_ms: performance.now(), error });
      this.#onArrival(error);
    }
  }
}

import { asError, DecodeError, FetchError } from "../core/errors";
import { tileName, type Tile } from "../geo/frame";
import type { LayerInfo, View } from "../geo/manifest";
import type { Cache } from "./cache";
import type { Decoder } from "./decoder";
import type { TileRequest, RequestQueue } from "./queue";
import type { Source } from "./source";
import { computeBytes, type TileData } from "./tileData";

/** A tile in memory. `data` is null when the tile is empty, or when the drawer keeps it for us. */
export interface CachedTile {
  data: TileData | null;
  readonly empty: boolean;
  /** As it was sent, and when it came (performance.now). */
  readonly transfer: { readonly bytes: number; readonly at_ms: number };
}

export interface TileResources {
  readonly cache: Cache<CachedTile>;
  readonly queue: RequestQueue;
  readonly decoder: Decoder;
}

const RETRY_AFTER_MS = 15_000;

/** The tiles of one rendering: fetched, decoded, kept. */
export class LayerTiles {
  readonly #name: string;
  readonly #source: Source;
  readonly #resources: TileResources;
  readonly #failed = new Map<string, { readonly at_ms: number; readonly error: Error }>();
  readonly #onArrival: (error: Error | null) => void;

  /** @param name unique in the map  @param arrived called after each tile, with what went wrong */
  constructor(name: string, source: Source, shared: TileResources, arrived: (error: Error | null) => void) {
    this.#name = name;
    this.#source = source;
    this.#resources = shared;
    this.#onArrival = arrived;
  }

  key(view: View, layer: LayerInfo, tile: Tile): string {
    return `${this.#name}/${view.id}/${layer.name}/${tileName(tile)}`;
  }

  /** The tile if it is in memory, which counts as use. */
  get(view: View, layer: LayerInfo, tile: Tile): CachedTile | undefined {
    return this.#resources.cache.get(this.key(view, layer, tile));
  }

  /** How large a tile in memory was as it came, and when; not a use. */
  getTransfer(view: View, layer: LayerInfo, tile: Tile): CachedTile["transfer"] | undefined {
    return this.#resources.cache.peek(this.key(view, layer, tile))?.transfer;
  }

  /** The drawer has a copy of the tile; ours is let go. Ids and depths are to be kept: picks read them. */
  releaseData(view: View, layer: LayerInfo | undefined, tile: Tile): void {
    const stored = layer && this.get(view, layer, tile);
    if (!stored) return;
    if (stored.data && "bitmap" in stored.data) stored.data.bitmap.close();
    stored.data = null;
  }

  /** True when a tile could not be had a short time ago. */
  hasFailed(view: View, layer: LayerInfo, tile: Tile): boolean {
    const failure = this.#failed.get(this.key(view, layer, tile));
    return failure !== undefined && performance.now() - failure.at_ms < RETRY_AFTER_MS;
  }

  /** Forgets failures, so that tiles are asked for again. */
  clearFailures(): void {
    this.#failed.clear();
  }

  makeRequest(view: View, layer: LayerInfo, tile: Tile): TileRequest {
    const key = this.key(view, layer, tile);
    return { key, run: (signal) => this.#load(key, view, layer, tile, signal) };
  }

  /** The decoded tile, fetched unless in memory; null when it is empty. @throws what the fetch threw */
  async fetch(view: View, layer: LayerInfo, tile: Tile): Promise<TileData | null> {
    if (!view.occupancy.has(tile)) return null;
    const held = this.get(view, layer, tile);
    if (held && (held.data || held.empty)) return held.data;
    await this.#resources.queue.runNow(this.makeRequest(view, layer, tile));
    const stored = this.get(view, layer, tile);
    if (!stored) throw this.#failed.get(this.key(view, layer, tile))?.error ?? new FetchError(`${this.key(view, layer, tile)}: the fetch was given up`);
    return stored.data;
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

import { asError, DecodeError, FetchError, isGone } from "../core/errors";
import { hasServiceWorker, isOffline } from "../core/network";
import { ancestor, childrenOf, tileName, type Tile } from "../geo/frame";
import { DATA_KINDS, LIGHT_KINDS, type LayerInfo, type View } from "../geo/manifest";
import type { Cache } from "./cache";
import { DENSE_DPR } from "./cover";
import type { Decoder } from "./decoder";
import type { TileRequest, RequestQueue } from "./queue";
import type { Source } from "./source";
import { computeBytes, DATA_TYPE, type TileData } from "./tileData";

/** A tile in memory. `data` is null when the tile is empty, or when only the drawer has it. */
export interface CachedTile {
  data: TileData | null;
  readonly empty: boolean;
  /** Bytes received (0 if the source decodes), and when (performance.now). */
  readonly transfer: { readonly bytes: number; readonly at_ms: number };
  /** Bytes from which other tiles are decoded without a request: those of a data tile, or of the tile above. */
  readonly packed?: ArrayBuffer | undefined;
}

export interface TileResources {
  readonly cache: Cache<CachedTile>;
  readonly queue: RequestQueue;
  readonly decoder: Decoder;
}

/** Waits before a failed tile is requested again, and before a server that does not answer is: the first, doubled with each failure, and the longest. */
const [TILE_WAIT_MS, SERVER_WAIT_MS, LONGEST_WAIT_MS] = [15_000, 1000, 240_000];

/** A failed tile. */
interface Failure {
  readonly error: Error;
  readonly count: number;
  /** When it may be requested again, performance.now. */
  readonly retry_ms: number;
}

/** Computes when to try again after a number of failures; without a network, never: see `clearFailures`. */
const computeRetry = (first_ms: number, count: number): number =>
  isOffline() ? Infinity : performance.now() + Math.min(first_ms * 2 ** (count - 1), LONGEST_WAIT_MS);

/** Fetches, decodes and keeps the tiles of one image layer. */
export class LayerTiles {
  readonly #name: string;
  readonly #source: Source;
  readonly #resources: TileResources;
  readonly #failed = new Map<string, Failure>();
  /** Causes that have been reported. */
  readonly #reported = new Set<string>();
  /** Keys of the tiles that are being fetched. */
  readonly #loading = new Set<string>();
  /** Bytes that are being fetched, which requests share. */
  readonly #fetching = new Map<string, ReturnType<Source["tile"]>>();
  /** While the server does not answer: the number of tries in a row, and when the next is due. */
  #silence = { tries: 0, retry_ms: 0 };
  readonly #onArrival: (error: Error | null) => void;

  /** @param name unique on the map  @param onArrival called when a frame may show more, with the error if a tile failed for a new reason */
  constructor(name: string, source: Source, resources: TileResources, onArrival: (error: Error | null) => void) {
    this.#name = name;
    this.#source = source;
    this.#resources = resources;
    this.#onArrival = onArrival;
  }

  key(view: View, layer: LayerInfo, tile: Tile): string {
    return `${this.#name}/${view.id}/${layer.name}/${layer.media_type === DATA_TYPE ? `${layer.kind}/` : ""}${tileName(tile)}`;
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

  /** Whether a tile is not requested now, since it failed a short time ago, or the server does not answer. */
  hasFailed(view: View, layer: LayerInfo, tile: Tile): boolean {
    const key = this.key(view, layer, tile);
    return !this.#loading.has(key) && (this.#isSilent || performance.now() < (this.#failed.get(key)?.retry_ms ?? 0));
  }

  /** Forgets failures, so that their tiles are requested again. */
  clearFailures(): void {
    this.#failed.clear();
    this.#reported.clear();
    this.#silence = { tries: 0, retry_ms: 0 };
  }

  get #isSilent(): boolean {
    return performance.now() < this.#silence.retry_ms;
  }

  makeRequest(view: View, layer: LayerInfo, tile: Tile): TileRequest {
    const key = this.key(view, layer, tile);
    return { key, run: (signal, isAhead) => this.#load(key, view, layer, tile, signal, isAhead) };
  }

  /** Returns a decoded tile, fetched if it is not in memory; null when it is empty. @throws the error of the fetch */
  async fetch(view: View, layer: LayerInfo, tile: Tile): Promise<TileData | null> {
    if (!view.occupancy.has(tile)) return null;
    const cached = this.get(view, layer, tile);
    if (cached && (cached.data || cached.empty)) return cached.data;
    if (this.#isSilent) throw new FetchError(`${this.key(view, layer, tile)}: the server does not answer`);
    await this.#resources.queue.runNow(this.makeRequest(view, layer, tile));
    const loaded = this.get(view, layer, tile);
    if (!loaded) throw this.#failed.get(this.key(view, layer, tile))?.error ?? new FetchError(`${this.key(view, layer, tile)}: aborted`);
    return loaded.data;
  }

  async #load(key: string, view: View, layer: LayerInfo, tile: Tile, signal: AbortSignal, isAhead: () => boolean): Promise<void> {
    if (this.#isSilent) return;
    const { tries } = this.#silence;
    if (tries > 0) this.#waitForServer(tries); // the first request alone finds out whether the server answers again
    this.#loading.add(key);
    try {
      const above = findAbove(layer, tile);
      const known = this.#findPacked(view, layer, tile, above);
      const found = known?.packed ?? (await this.#fetch(view, layer, above ?? tile, signal));
      const [bytes, decoded] = found && "kind" in found ? [null, found] : [found, null];
      const transfer = known?.transfer ?? { bytes: bytes?.byteLength ?? 0, at_ms: performance.now() }; // the bytes move to another thread
      const packed = bytes && (above ?? layer.media_type === DATA_TYPE) ? bytes : undefined;
      const data = bytes
        ? await this.#resources.decoder.decode(layer.kind, layer.media_type, bytes, packed !== undefined, above && tile)
        : decoded;
      if (signal.aborted) {
        if (data && "bitmap" in data) data.bitmap.close();
        return;
      }
      this.#resources.cache.set(
        key,
        { data, empty: !data, transfer, packed },
        data ? computeBytes(data) * (data.kind === "id" || data.kind === "depth" ? 2 : 1) + (packed?.byteLength ?? 0) : 64,
      );
      this.#failed.delete(key);
      this.#silence = { tries: 0, retry_ms: 0 };
      if (!isAhead()) this.#onArrival(null);
    } catch (reason) {
      if (signal.aborted) return;
      const name = `tile ${view.id}/${layer.name}/${tileName(tile)}`;
      const error = reason instanceof DecodeError ? new DecodeError(`${name}: ${reason.message}`) : asError(reason);
      const count = (this.#failed.get(key)?.count ?? 0) + 1;
      this.#failed.set(key, { error, count, retry_ms: computeRetry(TILE_WAIT_MS, count) });
      if (error instanceof FetchError && error.status === 0 && !hasServiceWorker() && tries === this.#silence.tries)
        this.#waitForServer(tries + 1);
      // The same cause has many messages, which differ by URL.
      const cause = error.name + error.message.replace(/\S*\/\S*/g, "");
      const silent = (isAhead() && !isGone(error)) || this.#reported.has(cause);
      if (!silent) this.#reported.add(cause);
      this.#onArrival(silent ? null : error);
    } finally {
      this.#loading.delete(key);
    }
  }

  /** Finds a tile that keeps the bytes of `tile`, or of the one above it that is fetched in its place. */
  #findPacked(view: View, layer: LayerInfo, tile: Tile, above: Tile | undefined): CachedTile | undefined {
    const keys = above
      ? childrenOf(above).map((child) => this.key(view, layer, child))
      : DATA_KINDS.map((kind) => this.key(view, { ...layer, kind }, tile));
    return keys.map((key) => this.#resources.cache.peek(key)).find((known) => known?.packed);
  }

  /** Fetches the bytes of a tile, once for all who need them. */
  async #fetch(view: View, layer: LayerInfo, tile: Tile, signal: AbortSignal): ReturnType<Source["tile"]> {
    const key = this.key(view, { ...layer, kind: "data" }, tile);
    for (let shared = this.#fetching.get(key); shared; shared = this.#fetching.get(key)) {
      try {
        return await shared;
      } catch (reason) {
        // The other request may be unwanted by now, and this one not.
        if (signal.aborted || asError(reason).name !== "AbortError") throw reason;
      }
    }
    const own = this.#source.tile(view, layer, tile, signal).finally(() => this.#fetching.delete(key));
    this.#fetching.set(key, own);
    return own;
  }

  /** Requests nothing for a while, which is longer after each try. */
  #waitForServer(tries: number): void {
    const retry_ms = computeRetry(SERVER_WAIT_MS, tries);
    this.#silence = { tries, retry_ms };
    if (retry_ms < Infinity) setTimeout(() => this.#onArrival(null), retry_ms - performance.now());
  }
}

/** Finds the tile above that is fetched in place of a tile: on dense screens, that of light, which has a quarter of the bytes for the same area. */
const findAbove = ({ kind }: LayerInfo, tile: Tile): Tile | undefined =>
  LIGHT_KINDS.includes(kind) && tile.z > 0 && devicePixelRatio >= DENSE_DPR ? ancestor(tile, 1) : undefined;

import { DENSE_DPR } from "./cover";

/** Minimum size of the cache. */
export const MIN_CACHE_BYTES = 24e6;
/** Bytes per device pixel, and on dense screens, whose tiles have fewer pixels. */
const [PIXEL_BYTES, DENSE_PIXEL_BYTES] = [60, 45];

/**
 * Computes the default size of a map's cache from the map's device pixels. Coarser tiles need less. It holds the tiles of some views: a smaller one
 * takes more memory, since the garbage of tiles that are decoded again and again is larger than the tiles.
 * @param finer additional levels of the tiles shown
 */
export const computeCacheBytes = ({ dpr, finer }: { readonly dpr: number; readonly finer: number }, pixels: number): number =>
  Math.max(MIN_CACHE_BYTES, (dpr >= DENSE_DPR ? DENSE_PIXEL_BYTES : PIXEL_BYTES) * pixels * 4 ** Math.min(0, finer));

interface CacheEntry<V> {
  readonly value: V;
  readonly bytes: number;
  /** Tick of the most recent use. */
  used: number;
}

/** Keeps the most recently used values up to a number of bytes. Never drops values that were used in the current tick, or in the previous one before the current tick has asked for them. */
export class Cache<V> {
  readonly #entries = new Map<string, CacheEntry<V>>();
  #limit_bytes: number;
  readonly #onDrop: (key: string, value: V) => void;
  #tick = 0;
  #bytes = 0;

  constructor(limit_bytes: number, onDrop: (key: string, value: V) => void) {
    this.#limit_bytes = limit_bytes;
    this.#onDrop = onDrop;
  }

  get bytes(): number {
    return this.#bytes;
  }

  get size(): number {
    return this.#entries.size;
  }

  /** Sets the limit, which applies from the next tick on. */
  setLimit(bytes: number): void {
    this.#limit_bytes = bytes;
  }

  /** Starts a tick: values used from now on are safe until the next one has started. */
  startTick(): void {
    this.#trim();
    this.#tick++;
  }

  /** Returns the value and counts it as used. */
  get(key: string): V | undefined {
    const entry = this.#entries.get(key);
    if (!entry) return undefined;
    if (entry.used !== this.#tick) {
      entry.used = this.#tick;
      this.#entries.delete(key);
      this.#entries.set(key, entry);
    }
    return entry.value;
  }

  /** Returns the value without counting it as used. */
  peek(key: string): V | undefined {
    return this.#entries.get(key)?.value;
  }

  set(key: string, value: V, bytes: number): void {
    this.delete(key);
    this.#entries.set(key, { value, bytes, used: this.#tick });
    this.#bytes += bytes;
    this.#trim();
  }

  delete(key: string): void {
    const entry = this.#entries.get(key);
    if (!entry) return;
    this.#entries.delete(key);
    this.#bytes -= entry.bytes;
    this.#onDrop(key, entry.value);
  }

  /** Drops the values that a predicate selects. */
  prune(unwanted: (key: string, value: V) => boolean): void {
    for (const [key, entry] of [...this.#entries]) if (unwanted(key, entry.value)) this.delete(key);
  }

  #trim(): void {
    for (const [key, entry] of this.#entries) {
      if (this.#bytes <= this.#limit_bytes || entry.used === this.#tick) return;
      this.delete(key);
    }
  }
}

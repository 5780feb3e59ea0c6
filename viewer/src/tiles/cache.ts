interface CacheEntry<V> {
  readonly value: V;
  readonly bytes: number;
  /** Tick of the last use. */
  used: number;
}

/** Keeps the most recently used values within a number of bytes. What was used in the current tick, or in the last before it has been asked for again, is never dropped. */
export class Cache<V> {
  readonly #entries = new Map<string, CacheEntry<V>>();
  #limit_bytes: number;
  readonly #onDrop: (key: string, value: V) => void;
  #tick = 0;
  #bytes = 0;

  constructor(limit_bytes: number, dropped: (key: string, value: V) => void) {
    this.#limit_bytes = limit_bytes;
    this.#onDrop = dropped;
  }

  get bytes(): number {
    return this.#bytes;
  }

  get size(): number {
    return this.#entries.size;
  }

  /** Keeps so many bytes from the next tick on. */
  setLimit(bytes: number): void {
    this.#limit_bytes = bytes;
  }

  /** A new tick: what is used from now on is safe until the one after it has begun. */
  startTick(): void {
    this.#trim();
    this.#tick++;
  }

  /** The value, which counts as use. */
  get(key: string): V | undefined {
    const held = this.#entries.get(key);
    if (!held) return undefined;
    if (held.used !== this.#tick) {
      held.used = this.#tick;
      this.#entries.delete(key);
      this.#entries.set(key, held);
    }
    return held.value;
  }

  /** The value, without counting as use. */
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
    const held = this.#entries.get(key);
    if (!held) return;
    this.#entries.delete(key);
    this.#bytes -= held.bytes;
    this.#onDrop(key, held.value);
  }

  /** Drops what the predicate names. */
  prune(unwanted: (key: string, value: V) => boolean): void {
    for (const [key, held] of [...this.#entries]) if (unwanted(key, held.value)) this.delete(key);
  }

  #trim(): void {
    for (const [key, held] of this.#entries) {
      if (this.#bytes <= this.#limit_bytes || held.used === this.#tick) return;
      this.delete(key);
    }
  }
}

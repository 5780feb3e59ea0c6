/** What a listener gets: the event's own fields, its name and who fired it. */
export type FiredEvent<T> = T & { type: string; target: unknown };
/** Called with each event. */
export type Listener<T> = (event: FiredEvent<T>) => void;

/** An event source. `E` maps event names to the fields of the event. Methods return `this`. */
export class Evented<E extends object> {
  readonly #listeners = new Map<keyof E, Map<unknown, Listener<never>>>();

  /** Calls a listener at each event of a type; the same listener once only. */
  on<K extends keyof E>(type: K, listener: Listener<E[K]>): this {
    return this.#add(type, listener, listener);
  }

  /** Calls a listener at the next event of a type. */
  once<K extends keyof E>(type: K, listener: Listener<E[K]>): this {
    return this.#add(type, listener, (event: FiredEvent<E[K]>) => {
      this.off(type, listener);
      listener(event);
    });
  }

  /** Without a listener: all listeners of that type. */
  off<K extends keyof E>(type: K, listener?: Listener<E[K]>): this {
    if (listener) this.#listeners.get(type)?.delete(listener);
    else this.#listeners.delete(type);
    return this;
  }

  /** Calls the listeners of a type now, in the order in which they came. */
  fire<K extends keyof E>(type: K, fields: E[K]): this {
    const event = { ...fields, type: String(type), target: this };
    for (const listener of [...(this.#listeners.get(type)?.values() ?? [])]) (listener as Listener<E[K]>)(event);
    return this;
  }

  /** Does anybody listen? */
  listens(type: keyof E): boolean {
    return (this.#listeners.get(type)?.size ?? 0) > 0;
  }

  #add<K extends keyof E>(type: K, handle: unknown, call: Listener<E[K]>): this {
    const listeners = this.#listeners.get(type) ?? new Map<unknown, Listener<never>>();
    this.#listeners.set(type, listeners.set(handle, call));
    return this;
  }
}

import { UsageError } from "./errors";

/** The argument of a listener: the event's fields, its type and its source. */
export type FiredEvent<T> = T & { type: string; target: unknown };
/** A function that receives events. */
export type Listener<T> = (event: FiredEvent<T>) => void;

/** An event source. `E` maps event types to their fields. Methods return `this`. */
export class Evented<E extends object> {
  readonly #listeners = new Map<keyof E, Map<unknown, Listener<never>>>();

  /** Its types of events; null: any. */
  protected get eventTypes(): readonly (keyof E)[] | null {
    return null;
  }

  /** Adds a listener for a type of event; adding it again has no effect. @throws UsageError for an unknown type */
  on<K extends keyof E>(type: K, listener: Listener<E[K]>): this {
    return this.#add(type, listener, listener);
  }

  /** Adds a listener that is called once. */
  once<K extends keyof E>(type: K, listener: Listener<E[K]>): this {
    return this.#add(type, listener, (event: FiredEvent<E[K]>) => {
      this.off(type, listener);
      listener(event);
    });
  }

  /** Removes a listener; without one, all listeners of that type. */
  off<K extends keyof E>(type: K, listener?: Listener<E[K]>): this {
    if (listener) this.#listeners.get(type)?.delete(listener);
    else this.#listeners.delete(type);
    return this;
  }

  /** Fires an event: calls its listeners in the order in which they were added. */
  fire<K extends keyof E>(type: K, fields: E[K]): this {
    const event = { ...fields, type: String(type), target: this };
    for (const listener of [...(this.#listeners.get(type)?.values() ?? [])]) (listener as Listener<E[K]>)(event);
    return this;
  }

  /** Whether an event has listeners. */
  listens(type: keyof E): boolean {
    return (this.#listeners.get(type)?.size ?? 0) > 0;
  }

  #add<K extends keyof E>(type: K, handle: unknown, call: Listener<E[K]>): this {
    const known = this.eventTypes;
    if (known && !known.includes(type)) throw new UsageError(`unknown event "${String(type)}"; use ${known.join(", ")}`);
    if (typeof handle !== "function") throw new UsageError(`on("${String(type)}"): expected a function as listener`);
    const listeners = this.#listeners.get(type) ?? new Map<unknown, Listener<never>>();
    this.#listeners.set(type, listeners.set(handle, call));
    return this;
  }
}

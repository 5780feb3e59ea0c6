import { Evented } from "./events";

/** Anything that can be added to a map. */
export interface Addable<M> {
  /** Kinds of tiles that it reads: while it is on the map, the map fetches them for everything in view. */
  readonly needs?: readonly ("id" | "depth")[];
  /** @internal Called by the map, once. */
  attachTo(map: M): void;
  /** @internal Called by the map, once. */
  detachFrom(map: M): void;
}

/** A map as seen by what is added to it. */
export interface LayerHost<M> {
  /** Adds a layer; does nothing if it is on the map already. */
  add(item: Addable<M>): unknown;
  /** Removes a layer; does nothing if it is not on the map. */
  discard(item: Addable<M>): unknown;
}

/** Base class of everything that is added to a map, like Leaflet's Layer; it is on one map at a time. `E` maps its events to their fields. */
export abstract class MapLayer<M extends LayerHost<M>, E extends object> extends Evented<E> implements Addable<M> {
  #map: M | undefined;

  /** Adds it to a map. */
  addTo(map: M): this {
    map.add(this);
    return this;
  }

  /** Removes it, and everything it shows, from its map. */
  remove(): this {
    this.#map?.discard(this);
    return this;
  }

  /** @internal */
  attachTo(map: M): void {
    this.#map = map;
    this.onAdd(map);
  }

  /** @internal */
  detachFrom(map: M): void {
    this.onRemove(map);
    this.#map = undefined;
  }

  /** Its map, while it is on one. */
  protected get map(): M | undefined {
    return this.#map;
  }

  /** Called when it is added to a map. */
  protected abstract onAdd(map: M): void;

  /** Called when it is removed; `this.map` is still set. */
  protected abstract onRemove(map: M): void;
}

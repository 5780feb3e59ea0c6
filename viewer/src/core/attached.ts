import { Evented } from "./events";
import type { Attachable, Holder } from "./surface";

/** Base of what is put on a map: on one at a time. `E` maps its events to their fields. */
export abstract class Attached<M extends Holder<M>, E extends object> extends Evented<E> implements Attachable<M> {
  #map: M | undefined;

  /** Puts it on a map. */
  addTo(map: M): this {
    map.add(this);
    return this;
  }

  /** Takes it off its map, with all that it showed there. */
  remove(): this {
    this.#map?.discard(this);
    return this;
  }

  /** @internal */
  onAdd(map: M): void {
    this.#map = map;
    this.enter(map);
  }

  /** @internal */
  onRemove(map: M): void {
    this.leave(map);
    this.#map = undefined;
  }

  /** The map that it is on. */
  protected get map(): M | undefined {
    return this.#map;
  }

  /** It is on a map now. */
  protected abstract enter(map: M): void;

  /** It leaves the map; `map` tells still which. */
  protected abstract leave(map: M): void;
}

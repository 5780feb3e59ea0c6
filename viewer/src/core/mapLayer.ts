import { Evented } from "./events";
import type { Addable, LayerHost } from "./overlayHost";

/** Base of what is put on a map: on one at a time. `E` maps its events to their fields. */
export abstract class MapLayer<M extends LayerHost<M>, E extends object> extends Evented<E> implements Addable<M> {
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
  attachTo(map: M): void {
    this.#map = map;
    this.onAdd(map);
  }

  /** @internal */
  detachFrom(map: M): void {
    this.onRemove(map);
    this.#map = undefined;
  }

  /** The map that it is on. */
  protected get map(): M | undefined {
    return this.#map;
  }

  /** It is on a map now. */
  protected abstract onAdd(map: M): void;

  /** It leaves the map; `map` tells still which. */
  protected abstract onRemove(map: M): void;
}

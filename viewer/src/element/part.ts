import type { Addable, imageLayer, map } from "../map3d";
import { PageElement } from "./attributes";

/** What a part sees of the `<map-3d>` around it. */
export interface Place {
  /** null while it is not in the page. */
  readonly map: map | null;
  /** A picture is seen or to come, not what stands in for it. */
  readonly drawn: boolean;
  /** @internal Learns from a layer whether there will be a picture. */
  watch(layer: imageLayer): void;
  /** @internal Tells of an error by the event `map-error`. */
  report(reason: unknown): void;
}

/** An element inside `<map-3d>` that puts something on its map. */
export abstract class part<T extends Addable<map>> extends PageElement {
  #item: T | null = null;
  #place: Place | null = null;
  #waits = false;

  /** What it has put on the map. */
  protected get item(): T | null {
    return this.#item;
  }

  /** From the attributes. @throws UsageError */
  protected abstract make(): T;
  /** Brings an attribute's new value to what is on the map; false: it has to be made anew. */
  protected abstract follow(item: T, name: string): boolean;
  /** It is on the map. */
  protected abstract added(item: T, place: Place): void;
  /** It is on no map. */
  protected abstract taken(): void;

  /** May it be on the map now? */
  protected fits(place: Place): boolean {
    return place.map !== null;
  }

  /** @internal */
  connectedCallback(): void {
    this.#settleSoon();
  }

  /** @internal */
  disconnectedCallback(): void {
    this.#settleSoon();
  }

  /** @internal */
  attributeChangedCallback(name: string): void {
    const place = this.#place;
    if (!place) return;
    try {
      if (!this.#item || !this.follow(this.#item, name)) this.enter(place);
    } catch (reason) {
      place.report(reason);
    }
  }

  /** @internal Goes onto the map, anew if it is there. */
  enter(place: Place): void {
    this.leave();
    this.#place = place;
    if (!this.fits(place)) return;
    try {
      this.#item = this.make();
      place.map?.add(this.#item);
      this.added(this.#item, place);
    } catch (reason) {
      place.report(reason);
    }
  }

  /** @internal */
  leave(): void {
    const [item, map] = [this.#item, this.#place?.map];
    this.#item = this.#place = null;
    if (item) map?.discard(item);
    this.taken();
  }

  /** After the script that is running, which may go on to set attributes, or put the element elsewhere. */
  #settleSoon(): void {
    if (this.#waits) return;
    this.#waits = true;
    queueMicrotask(() => {
      this.#waits = false;
      const around = this.isConnected ? this.closest<HTMLElement & Partial<Place>>("map-3d") : null;
      const place = around?.map ? (around as HTMLElement & Place) : null;
      if (place === this.#place) return;
      this.leave();
      if (place) this.enter(place);
    });
  }
}

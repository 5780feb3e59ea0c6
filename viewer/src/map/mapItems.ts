import type { Addable } from "../core/mapLayer";
import type { LayerKind } from "../tiles/tileData";
import { Marker } from "../overlay/marker";
import { ImageLayer } from "./imageLayer";

/** What is on a map: image layers, markers, popups and others. */
export class MapItems<M> {
  /** Image layers, lowest first. */
  layers: readonly ImageLayer[] = [];
  readonly #all = new Set<Addable<M>>();
  #onLoadError: ((error: Error) => void)[] = [];
  readonly #onSelect: (selected: Marker) => void;

  /** @param onSelect called when a marker is selected; the others are deselected */
  constructor(onSelect: (selected: Marker) => void) {
    this.#onSelect = onSelect;
  }

  get all(): readonly Addable<M>[] {
    return [...this.#all];
  }

  get markers(): readonly Marker[] {
    return this.all.filter((item) => item instanceof Marker);
  }

  /** Calls functions, once, as soon as no rendering could be loaded, and tells them why. */
  onLoadError(...more: ((error: Error) => void)[]): void {
    this.#onLoadError.push(...more);
    const error = this.layers[0]?.loadError;
    if (error && this.layers.every(({ loadError }) => loadError)) for (const call of this.#onLoadError.splice(0)) call(error);
  }

  /** Attribution texts of all layers. */
  get attributions(): readonly string[] {
    return [...new Set(this.layers.map(({ attribution }) => attribution).filter((text) => text !== ""))];
  }

  /** Lists kinds of tiles that are read, in addition to those shown: by the items, and ids with `ids`. */
  listNeeds(ids: boolean): readonly LayerKind[] {
    return [...new Set([...(ids ? (["id"] as const) : []), ...this.all.flatMap(({ needs }) => needs ?? [])])];
  }

  /** @returns false when the item is on the map already */
  add(item: Addable<M>): boolean {
    if (this.#all.has(item)) return false;
    this.#all.add(item);
    if (item instanceof ImageLayer) this.layers = [...this.layers, item];
    if (item instanceof Marker) item.on("select", this.#select);
    return true;
  }

  /** @returns false when the item is not on the map */
  delete(item: Addable<M>): boolean {
    if (!this.#all.delete(item)) return false;
    this.layers = this.layers.filter((layer) => layer !== item);
    if (item instanceof Marker) item.off("select", this.#select);
    return true;
  }

  /** Deselects all markers but one. */
  deselectMarkers(except?: Marker): void {
    for (const each of this.markers) if (each !== except) each.select(false);
  }

  readonly #select = ({ marker: selected }: { marker: Marker }): void => {
    this.deselectMarkers(selected);
    this.#onSelect(selected);
  };
}

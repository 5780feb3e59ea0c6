import type { Addable, ImageLayer, Map3D } from "../map3d";
import { PageElement } from "./attributes";

/** The `<map-3d>` that contains a part. */
export interface ElementHost {
  /** null while the element is not in the page. */
  readonly map: Map3D | null;
  /** True while the map, not the fallback content, is shown. */
  readonly drawn: boolean;
  /** @internal Observes whether a layer loads. */
  watch(layer: ImageLayer): void;
  /** @internal Fires the event `map-error`. */
  report(reason: unknown): void;
}

/** An element inside `<map-3d>` that adds an item to its map. */
export abstract class Part<T extends Addable<Map3D>> extends PageElement {
  #item: T | null = null;
  #host: ElementHost | null = null;
  #scheduled = false;

  /** The item on the map. */
  protected get item(): T | null {
    return this.#item;
  }

  /** Creates the item from the attributes. @throws UsageError */
  protected abstract create(): T;
  /** Applies a changed attribute to the item. @returns false when the item must be created again */
  protected abstract update(item: T, name: string): boolean;
  /** Called after the item was added to the map. */
  protected abstract added(item: T, host: ElementHost): void;
  /** Called after the item was removed from the map. */
  protected abstract removed(): void;

  /** Can the item be on the map now? */
  protected isReady(host: ElementHost): boolean {
    return host.map !== null;
  }

  /** @internal */
  connectedCallback(): void {
    this.#scheduleUpdate();
  }

  /** @internal */
  disconnectedCallback(): void {
    this.#scheduleUpdate();
  }

  /** @internal */
  attributeChangedCallback(name: string): void {
    const host = this.#host;
    if (!host) return;
    try {
      if (!this.#item || !this.update(this.#item, name)) this.enter(host);
    } catch (reason) {
      host.report(reason);
    }
  }

  /** @internal Adds the item to the map; creates it again if it is there. */
  enter(host: ElementHost): void {
    this.leave();
    this.#host = host;
    if (!this.isReady(host)) return;
    try {
      this.#item = this.create();
      host.map?.add(this.#item);
      this.added(this.#item, host);
    } catch (reason) {
      host.report(reason);
    }
  }

  /** @internal */
  leave(): void {
    const [item, map] = [this.#item, this.#host?.map];
    this.#item = this.#host = null;
    if (item) map?.discard(item);
    this.removed();
  }

  /** Runs after the current script, which may set more attributes or move the element. */
  #scheduleUpdate(): void {
    if (this.#scheduled) return;
    this.#scheduled = true;
    queueMicrotask(() => {
      this.#scheduled = false;
      const around = this.isConnected ? this.closest<HTMLElement & Partial<ElementHost>>("map-3d") : null;
      const host = around?.map ? (around as HTMLElement & ElementHost) : null;
      if (host === this.#host) return;
      this.leave();
      if (host) this.enter(host);
    });
  }
}

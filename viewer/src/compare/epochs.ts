import { adoptStyles, element } from "../core/dom";
import { UsageError } from "../core/errors";
import { MapLayer, type imageLayer, type map } from "../map3d";
import { STYLES } from "./styles";
import { getCompareMessages } from "./i18n";

/** A state of the city. */
export interface Epoch {
  readonly layer: imageLayer;
  /** Such as a year. */
  readonly label: string;
}

/** Of an `epochs`. */
export interface EpochsOptions {
  /** Number of the one that is shown first. Default the last. */
  shown?: number;
  /** How long the one before fades. Default 250; 0 where the user wants no movement. */
  fade_ms?: number;
  /** Where the slider goes. Default the map's lower edge. */
  container?: HTMLElement;
}

/** Of an `epochs`. */
export interface EpochsEvents {
  /** Another one was chosen. */
  change: { epoch: Epoch; index: number };
}

/** A slider over layers of which one is shown; the one before stays until the next is complete, then it fades. Adds the layers to the map. */
export class epochs extends MapLayer<map, EpochsEvents> {
  readonly #list: readonly Epoch[];
  readonly #fade_ms: number;
  readonly #container: HTMLElement | undefined;
  readonly #box: HTMLElement;
  readonly #slider: HTMLInputElement;
  readonly #name = element("output", "");
  #shown: number;
  #leaving: (() => void) | undefined;

  /** @throws UsageError without at least two epochs, or when the one to show first is none of them */
  constructor(list: readonly Epoch[], { shown = list.length - 1, fade_ms = 250, container }: EpochsOptions = {}) {
    super();
    if (list.length < 2) throw new UsageError("epochs need at least two layers");
    if (!Object.hasOwn(list, shown)) throw new UsageError(`epoch ${String(shown)} is none of 0 to ${String(list.length - 1)}`);
    this.#list = list;
    this.#shown = shown;
    this.#fade_ms = fade_ms;
    this.#container = container;
    this.#slider = element("input", "", { type: "range", min: "0", max: String(list.length - 1), step: "1", value: String(shown) });
    this.#slider.addEventListener("input", () => { this.show(Number(this.#slider.value)); });
    this.#slider.addEventListener("keydown", (event) => { event.stopPropagation(); });
    const ends = [list[0], list[list.length - 1]].map((epoch) => element("span", "", {}, epoch?.label ?? ""));
    this.#box = element("div", "map3d-epochs", {}, this.#name, this.#slider, element("div", "", { "aria-hidden": "true" }, ...ends));
  }

  /** Number of the one that is shown. */
  get shown(): number {
    return this.#shown;
  }

  /** Shows another one. @throws UsageError */
  show(index: number): this {
    const epoch = this.#list[index];
    if (!epoch) throw new UsageError(`epoch ${String(index)} is none of 0 to ${String(this.#list.length - 1)}`);
    if (index === this.#shown) return this;
    const before = this.#shown;
    this.#shown = index;
    this.#label();
    this.#change(before);
    return this.fire("change", { epoch, index });
  }

  protected onAdd(map: map): void {
    adoptStyles(document, STYLES);
    this.#slider.setAttribute("aria-label", getCompareMessages(map.language).time);
    this.#label();
    this.#list.forEach(({ layer }, k) => layer.setOpacity(k === this.#shown ? 1 : 0).addTo(map));
    (this.#container ?? map.overlayPane).append(this.#box);
  }

  protected onRemove(map: map): void {
    this.#leaving?.();
    this.#box.remove();
    for (const { layer } of this.#list) map.discard(layer.setOpacity(1));
  }

  #label(): void {
    const label = this.#list[this.#shown]?.label ?? "";
    this.#slider.value = String(this.#shown);
    this.#slider.setAttribute("aria-valuetext", label);
    this.#name.textContent = label;
  }

  /** The new one comes; the old ones go when it is here. */
  #change(before: number): void {
    const map = this.map;
    if (!map) return;
    this.#leaving?.();
    const [next, old] = [this.#list[this.#shown]?.layer, this.#list[before]?.layer];
    for (const { layer } of this.#list) if (layer !== next && layer !== old) layer.setOpacity(0);
    next?.setOpacity(1);
    if (old) this.#leave(map, old);
  }

  #leave(map: map, old: imageLayer): void {
    const fade_ms = matchMedia("(prefers-reduced-motion: reduce)").matches ? 0 : this.#fade_ms;
    let frame = 0;
    const end = (): void => {
      map.off("idle", start);
      cancelAnimationFrame(frame);
      old.setOpacity(0);
      this.#leaving = undefined;
    };
    const start = (): void => {
      map.off("idle", start);
      const from = performance.now();
      const step = (now: number): void => {
        const left = fade_ms > 0 ? 1 - (now - from) / fade_ms : 0;
        if (left <= 0) {
          end();
          return;
        }
        old.setOpacity(Math.min(left, 0.99));
        frame = requestAnimationFrame(step);
      };
      step(from);
    };
    this.#leaving = end;
    map.on("idle", start);
  }
}

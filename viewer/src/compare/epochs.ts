import { adoptStyles, element, prefersReducedMotion } from "../core/dom";
import { UsageError } from "../core/errors";
import { MapLayer, type ImageLayer, type Map3D } from "../map3d";
import { STYLES } from "./styles";
import { getCompareMessages } from "./i18n";

/** A state of the city at one time. */
export interface Epoch {
  readonly layer: ImageLayer;
  /** Label, such as a year. */
  readonly label: string;
}

/** Options of `epochs`. */
export interface EpochsOptions {
  /** Index of the epoch to show first. Default: the last. */
  shown?: number;
  /** Duration of the cross-fade. Default 250; 0 under `prefers-reduced-motion`. */
  fade_ms?: number;
  /** Element for the slider. Default: the map, at its lower edge. */
  container?: HTMLElement;
}

/** Events of `epochs`. */
export interface EpochsEvents {
  /** The shown epoch has changed. */
  change: { epoch: Epoch; index: number };
}

/** A slider that shows one of several layers. The previous layer stays until the next one is complete, then fades out. Adds the layers to the map. */
export class Epochs extends MapLayer<Map3D, EpochsEvents> {
  readonly #list: readonly Epoch[];
  readonly #fade_ms: number;
  readonly #container: HTMLElement | undefined;
  readonly #box: HTMLElement;
  readonly #slider: HTMLInputElement;
  readonly #name = element("output", "");
  #shown: number;
  #endFade: (() => void) | undefined;

  /** @throws UsageError for fewer than two epochs, or when `shown` is out of range */
  constructor(list: readonly Epoch[], { shown = list.length - 1, fade_ms = 250, container }: EpochsOptions = {}) {
    super();
    if (list.length < 2) throw new UsageError(`epochs needs at least two layers, got ${String(list.length)}`);
    if (!Object.hasOwn(list, shown)) throw new UsageError(`epoch ${String(shown)} is out of range 0 to ${String(list.length - 1)}`);
    this.#list = list;
    this.#shown = shown;
    this.#fade_ms = fade_ms;
    this.#container = container;
    this.#slider = element("input", "", { type: "range", min: "0", max: String(list.length - 1), step: "1", value: String(shown) });
    this.#slider.addEventListener("input", () => this.show(Number(this.#slider.value)));
    this.#slider.addEventListener("keydown", (event) => event.stopPropagation());
    const ends = [list[0], list[list.length - 1]].map((epoch) => element("span", "", {}, epoch?.label ?? ""));
    this.#box = element("div", "map3d-epochs", {}, this.#name, this.#slider, element("div", "", { "aria-hidden": "true" }, ...ends));
  }

  /** Index of the shown epoch. */
  get shown(): number {
    return this.#shown;
  }

  /** Shows an epoch. @throws UsageError when the index is out of range */
  show(index: number): this {
    const epoch = this.#list[index];
    if (!epoch) throw new UsageError(`epoch ${String(index)} is out of range 0 to ${String(this.#list.length - 1)}`);
    if (index === this.#shown) return this;
    const before = this.#shown;
    this.#shown = index;
    this.#updateLabel();
    this.#switchFrom(before);
    return this.fire("change", { epoch, index });
  }

  protected onAdd(map: Map3D): void {
    adoptStyles(document, STYLES);
    this.#slider.setAttribute("aria-label", getCompareMessages(map.language).time);
    this.#updateLabel();
    this.#list.forEach(({ layer }, k) => layer.setOpacity(k === this.#shown ? 1 : 0).addTo(map));
    (this.#container ?? map.overlayPane).append(this.#box);
  }

  protected onRemove(map: Map3D): void {
    this.#endFade?.();
    this.#box.remove();
    for (const { layer } of this.#list) map.discard(layer.setOpacity(1));
  }

  #updateLabel(): void {
    const label = this.#list[this.#shown]?.label ?? "";
    this.#slider.value = String(this.#shown);
    this.#slider.setAttribute("aria-valuetext", label);
    this.#name.textContent = label;
  }

  /** Shows the new layer at once and hides the old one when the new one is complete. */
  #switchFrom(before: number): void {
    const map = this.map;
    if (!map) return;
    this.#endFade?.();
    const [next, old] = [this.#list[this.#shown]?.layer, this.#list[before]?.layer];
    for (const { layer } of this.#list) if (layer !== next && layer !== old) layer.setOpacity(0);
    next?.setOpacity(1);
    if (old) this.#fadeOut(map, old);
  }

  #fadeOut(map: Map3D, old: ImageLayer): void {
    const fade_ms = prefersReducedMotion() ? 0 : this.#fade_ms;
    let frame = 0;
    const end = (): void => {
      map.off("idle", start);
      cancelAnimationFrame(frame);
      old.setOpacity(0);
      this.#endFade = undefined;
    };
    const start = (): void => {
      map.off("idle", start);
      const from = performance.now();
      const step = (now: number): void => {
        const opacity = fade_ms > 0 ? 1 - (now - from) / fade_ms : 0;
        if (opacity <= 0) {
          end();
          return;
        }
        old.setOpacity(Math.min(opacity, 0.99));
        frame = requestAnimationFrame(step);
      };
      step(from);
    };
    this.#endFade = end;
    map.on("idle", start);
  }
}

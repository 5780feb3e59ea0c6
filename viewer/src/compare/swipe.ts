import { adoptStyles, element, icon } from "../core/dom";
import { UsageError } from "../core/errors";
import { clamp } from "../core/vec";
import { MapLayer, type ImageLayer, type Map3D } from "../map3d";
import { STYLES } from "./styles";
import { getCompareMessages } from "./i18n";

export interface SwipeOptions {
  /** Position of the divider: 0 is the left edge, 1 the right. Default 0.5. */
  at?: number;
  /** Labels left and right of the divider. Default: none. */
  names?: readonly [left: string, right: string];
}

export interface SwipeEvents {
  /** The divider has moved. */
  change: { at: number };
}

/** One layer, or several layers on the same side. */
export type Layers = ImageLayer | readonly ImageLayer[];

const ARROWS = "M9 7l-5 5 5 5M15 7l5 5-5 5";
const STEP = 0.02;

const list = (layers: Layers): readonly ImageLayer[] =>
  Array.isArray(layers) ? (layers as readonly ImageLayer[]) : [layers as ImageLayer];

/** Shows some layers left of a divider and others right of it. A pointer or the arrow keys move the divider. Other layers of the map are not clipped. */
export class Swipe extends MapLayer<Map3D, SwipeEvents> {
  readonly #sides: readonly [readonly ImageLayer[], readonly ImageLayer[]];
  readonly #divider: HTMLElement;
  #at: number;

  /** @throws UsageError when a layer is on both sides */
  constructor(left: Layers, right: Layers, { at = 0.5, names }: SwipeOptions = {}) {
    super();
    this.#sides = [list(left), list(right)];
    if (this.#sides[0].some((layer) => this.#sides[1].includes(layer))) throw new UsageError("a layer cannot be on both sides of a swipe");
    this.#at = clamp(at, 0, 1);
    this.#divider = element(
      "div",
      "map3d-swipe",
      { role: "slider", tabindex: "0", "aria-orientation": "horizontal", "aria-valuemin": "0", "aria-valuemax": "100" },
      ...(names ?? []).map((name) => element("span", "map3d-swipe-name", {}, name)),
      icon(ARROWS),
    );
    if (names) this.#divider.setAttribute("aria-description", names.join(" | "));
    this.#divider.addEventListener("pointerdown", (event) => this.#startDrag(event));
    this.#divider.addEventListener("keydown", (event) => this.#onKeyDown(event));
  }

  /** Position of the divider: 0 is the left edge, 1 the right. */
  get at(): number {
    return this.#at;
  }

  /** Moves the divider: 0 is the left edge, 1 the right. */
  setAt(at: number): this {
    const next = clamp(at, 0, 1);
    if (!(next !== this.#at)) return this;
    this.#at = next;
    this.#apply();
    return this.fire("change", { at: next });
  }

  protected onAdd(map: Map3D): void {
    adoptStyles(document, STYLES);
    this.#divider.setAttribute("aria-label", getCompareMessages(map.language).divider);
    map.overlayPane.append(this.#divider);
    this.#apply();
  }

  protected onRemove(): void {
    this.#divider.remove();
    for (const layer of this.#sides.flat()) layer.setClip(null);
  }

  #apply(): void {
    this.#divider.style.left = `${String(100 * this.#at)}%`;
    this.#divider.setAttribute("aria-valuenow", String(Math.round(100 * this.#at)));
    if (!this.map) return;
    for (const layer of this.#sides[0]) layer.setClip([0, 0, this.#at, 1]);
    for (const layer of this.#sides[1]) layer.setClip([this.#at, 0, 1, 1]);
  }

  #startDrag(event: PointerEvent): void {
    if (event.button !== 0) return;
    const divider = this.#divider;
    divider.setPointerCapture(event.pointerId);
    const { left, width } = divider.getBoundingClientRect();
    const offset_px = event.clientX - (left + width / 2);
    const move = ({ clientX }: PointerEvent): void => {
      const box = this.map?.container.getBoundingClientRect();
      if (box) this.setAt((clientX - offset_px - box.left) / box.width);
    };
    const end = (): void => divider.removeEventListener("pointermove", move);
    divider.addEventListener("pointermove", move);
    divider.addEventListener("lostpointercapture", end, { once: true });
    event.preventDefault();
    divider.focus({ preventScroll: true });
  }

  #onKeyDown(event: KeyboardEvent): void {
    const to = {
      ArrowLeft: this.#at - STEP,
      ArrowRight: this.#at + STEP,
      ArrowDown: this.#at - STEP,
      ArrowUp: this.#at + STEP,
      PageDown: this.#at - 5 * STEP,
      PageUp: this.#at + 5 * STEP,
      Home: 0,
      End: 1,
    }[event.key];
    if (to === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    this.setAt(to);
  }
}

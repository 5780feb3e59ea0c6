import { element } from "../core/dom";
import type { Vec2 } from "../core/vec";
import type { PlacedFeature } from "./placedFeature";

/** Maximum number of features in the list; zooming in shows the others. */
const MAX_FEATURES = 100;

/** A feature in view and its anchor on the screen (CSS pixels). */
export interface VisibleFeature {
  readonly placed: PlacedFeature;
  readonly at: Vec2;
}

/** Features in view as buttons, for keyboards and screen readers. A button is visible only while it has the focus. */
export class FeatureList {
  readonly box = element("ul", "map3d-features");
  readonly #nameOf: (placed: PlacedFeature) => string;
  readonly #onFocus: (placed: PlacedFeature | null) => void;
  readonly #onPress: (placed: PlacedFeature) => void;
  readonly #rows = new Map<PlacedFeature, { row: HTMLElement; button: HTMLButtonElement }>();

  constructor(
    label: string,
    name: (placed: PlacedFeature) => string,
    focus: (placed: PlacedFeature | null) => void,
    press: (placed: PlacedFeature) => void,
  ) {
    this.box.setAttribute("aria-label", label);
    [this.#nameOf, this.#onFocus, this.#onPress] = [name, focus, press];
  }

  /** Updates the list. Features that stay keep their buttons and the focus. */
  show(features: readonly VisibleFeature[]): void {
    const shown = features.slice(0, MAX_FEATURES);
    const current = new Set(shown.map(({ placed }) => placed));
    for (const [placed, { row }] of [...this.#rows]) {
      if (current.has(placed)) continue;
      row.remove();
      this.#rows.delete(placed);
    }
    for (const { placed, at } of shown) {
      const { button } = this.#rows.get(placed) ?? this.#add(placed);
      button.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px) translate(-50%, -150%)`;
    }
  }

  #add(placed: PlacedFeature): { row: HTMLElement; button: HTMLButtonElement } {
    const button = element("button", "", { type: "button" }, this.#nameOf(placed));
    button.addEventListener("focus", () => this.#onFocus(placed));
    button.addEventListener("blur", () => this.#onFocus(null));
    button.addEventListener("click", () => this.#onPress(placed));
    const entry = { row: element("li", "", {}, button), button };
    this.#rows.set(placed, entry);
    this.box.append(entry.row);
    return entry;
  }
}

import { element } from "../core/dom";
import type { Vec2 } from "../core/vec";
import type { Placed } from "./placed";

/** Features in the list at once; who wants more zooms in. */
const MOST = 100;

/** A feature that is in view, and where it is seen (CSS pixels). */
export interface InView {
  readonly placed: Placed;
  readonly at: Vec2;
}

/** Features in view as buttons, for keyboards and screen readers; seen only while they have the focus. */
export class FeatureList {
  readonly box = element("ul", "map3d-features");
  readonly #name: (placed: Placed) => string;
  readonly #focus: (placed: Placed | null) => void;
  readonly #press: (placed: Placed) => void;
  readonly #rows = new Map<Placed, { row: HTMLElement; button: HTMLButtonElement }>();

  constructor(label: string, name: (placed: Placed) => string, focus: (placed: Placed | null) => void, press: (placed: Placed) => void) {
    this.box.setAttribute("aria-label", label);
    [this.#name, this.#focus, this.#press] = [name, focus, press];
  }

  /** Those that stay keep their buttons, and the focus. */
  show(features: readonly InView[]): void {
    const shown = features.slice(0, MOST);
    const now = new Set(shown.map(({ placed }) => placed));
    for (const [placed, { row }] of [...this.#rows]) {
      if (now.has(placed)) continue;
      row.remove();
      this.#rows.delete(placed);
    }
    for (const { placed, at } of shown) {
      const { button } = this.#rows.get(placed) ?? this.#add(placed);
      button.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px) translate(-50%, -150%)`;
    }
  }

  #add(placed: Placed): { row: HTMLElement; button: HTMLButtonElement } {
    const button = element("button", "", { type: "button" }, this.#name(placed));
    button.addEventListener("focus", () => { this.#focus(placed); });
    button.addEventListener("blur", () => { this.#focus(null); });
    button.addEventListener("click", () => { this.#press(placed); });
    const made = { row: element("li", "", {}, button), button };
    this.#rows.set(placed, made);
    this.box.append(made.row);
    return made;
  }
}

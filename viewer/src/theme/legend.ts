import { element } from "../core/dom";
import type { Classes } from "./classes";

/** Colours and what they stand for. A class that is pressed is shown with the others that are; with none pressed all are shown. */
export class Legend {
  readonly box: HTMLFieldSetElement;
  readonly #chosen = new Set<number>();
  readonly #buttons: readonly HTMLButtonElement[];
  readonly #changed: (chosen: ReadonlySet<number>) => void;

  constructor(title: string, { classes, ordered }: Classes, changed: (chosen: ReadonlySet<number>) => void) {
    this.#changed = changed;
    this.#buttons = classes.map(({ label, color }, k) => {
      const swatch = element("i", "");
      swatch.style.background = color;
      const button = element("button", "", { type: "button", "aria-pressed": "false", title: label }, swatch, element("span", "", {}, label));
      button.addEventListener("click", () => { this.#toggle(k); });
      return button;
    });
    const rows = this.#buttons.map((button) => element("li", "", {}, button));
    this.box = element("fieldset", `map3d-legend${ordered ? " map3d-legend-ordered" : ""}`, {}, element("legend", "", { title }, title), element("ul", "", {}, ...rows));
  }

  #toggle(k: number): void {
    if (!this.#chosen.delete(k)) this.#chosen.add(k);
    this.#buttons.forEach((button, at) => { button.setAttribute("aria-pressed", String(this.#chosen.has(at))); });
    this.box.classList.toggle("map3d-legend-chosen", this.#chosen.size > 0);
    this.#changed(this.#chosen);
  }
}

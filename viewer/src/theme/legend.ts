import { element } from "../core/dom";
import type { Classification } from "./classes";

/** A legend with a toggle button per class. Shows only the pressed classes; all if none is pressed. */
export class Legend {
  readonly box: HTMLFieldSetElement;
  readonly #pressed = new Set<number>();
  readonly #buttons: readonly HTMLButtonElement[];
  readonly #onChange: (pressed: ReadonlySet<number>) => void;

  constructor(title: string, { classes, ordered }: Classification, onChange: (pressed: ReadonlySet<number>) => void) {
    this.#onChange = onChange;
    this.#buttons = classes.map(({ label, color }, k) => {
      const swatch = element("i", "");
      swatch.style.background = color;
      const button = element(
        "button",
        "",
        { type: "button", "aria-pressed": "false", title: label },
        swatch,
        element("span", "", {}, label),
      );
      button.addEventListener("click", () => this.#toggle(k));
      return button;
    });
    const rows = this.#buttons.map((button) => element("li", "", {}, button));
    this.box = element(
      "fieldset",
      `map3d-legend${ordered ? " map3d-legend-ordered" : ""}`,
      {},
      element("legend", "", { title }, title),
      element("ul", "", {}, ...rows),
    );
  }

  #toggle(k: number): void {
    if (!this.#pressed.delete(k)) this.#pressed.add(k);
    this.#buttons.forEach((button, at) => button.setAttribute("aria-pressed", String(this.#pressed.has(at))));
    this.box.classList.toggle("map3d-legend-filtered", this.#pressed.size > 0);
    this.#onChange(this.#pressed);
  }
}

import type { map } from "./map3d.mjs";
import { writePlace } from "./place";

/** Addresses may not be changed as often as a slider moves. */
const ADDRESS_MS = 400;

/** Keeps the view, the time, the chosen object and the attribute that colours in the page's address. */
export class Address {
  /** Of the chosen object; 0: none. */
  id = 0;
  /** Number of the epoch that is shown. */
  epoch = 0;
  /** The attribute by which objects are coloured; "": none. */
  by = "";
  readonly #view: map;
  #timer = 0;
  #quiet = false;

  constructor(view: map) {
    this.#view = view;
    view.on("moveend", () => { this.write(); });
    view.on("directionchange", () => { this.write(); });
    view.on("lightchange", () => {
      clearTimeout(this.#timer);
      this.#timer = window.setTimeout(() => { this.write(); }, ADDRESS_MS);
    });
  }

  /** `step`: as a step that the back button takes back. */
  write(step = false): void {
    if (!this.#quiet) writePlace(this.#view, this, step);
  }

  /** Does something without writing, such as going where the address says, of which the first part would write over the rest. */
  quietly(act: () => void): void {
    this.#quiet = true;
    act();
    this.#quiet = false;
  }
}

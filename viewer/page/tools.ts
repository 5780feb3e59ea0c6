import type { map } from "./map3d.mjs";
import type { measure } from "./map3d-measure.mjs";
import { byId } from "./dom";
import { toast } from "./toast";
import { message } from "./i18n";

const HINTS = { line: "lineHint", area: "areaHint", profile: "profileHint" } as const;
type Kind = keyof typeof HINTS;

/** Measuring tools, one active at a time. A second press on its button closes the active tool. */
export class Tools {
  readonly #view: map;
  readonly #buttons: ReadonlyMap<Kind, HTMLElement>;
  #tool: measure | undefined;
  #kind: Kind | null = null;

  constructor(view: map) {
    this.#view = view;
    this.#buttons = new Map((Object.keys(HINTS) as Kind[]).map((kind) => [kind, byId(`measure-${kind}`)]));
    for (const [kind, button] of this.#buttons) {
      button.addEventListener("click", () => void this.#activate(this.#kind === kind ? null : kind));
      button.hidden = false;
    }
  }

  /** True while clicks on the map belong to a tool. */
  get active(): boolean {
    return this.#kind !== null;
  }

  async #activate(kind: Kind | null): Promise<void> {
    this.#kind = kind;
    this.#tool?.remove();
    this.#tool = undefined;
    for (const [buttonKind, button] of this.#buttons) button.setAttribute("aria-pressed", String(buttonKind === kind));
    byId("hint").hidden = kind === null;
    if (kind === null) return;
    byId("hint").textContent = message(HINTS[kind]);
    try {
      const entry = await import("./map3d-measure.mjs");
      if (this.#kind === kind) this.#tool = new entry.measure({ kind }).addTo(this.#view);
    } catch (reason) {
      toast(`${message("toolFailed")}: ${String(reason)}`);
    }
  }
}

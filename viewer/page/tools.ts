import type { map } from "./map3d.mjs";
import type { measure } from "./map3d-measure.mjs";
import { byId } from "./dom";
import { toast } from "./messages";
import { say } from "./i18n";

const HINTS = { line: "lineHint", area: "areaHint", profile: "profileHint" } as const;
type Kind = keyof typeof HINTS;

/** Buttons that measure on the map: one at a time; pressed again, it is put away. */
export class Tools {
  readonly #view: map;
  readonly #buttons: ReadonlyMap<Kind, HTMLElement>;
  #tool: measure | undefined;
  #kind: Kind | null = null;

  constructor(view: map) {
    this.#view = view;
    this.#buttons = new Map((Object.keys(HINTS) as Kind[]).map((kind) => [kind, byId(`measure-${kind}`)]));
    for (const [kind, button] of this.#buttons) {
      button.addEventListener("click", () => void this.#choose(this.#kind === kind ? null : kind));
      button.hidden = false;
    }
  }

  /** Clicks on the map belong to a tool. */
  get active(): boolean {
    return this.#kind !== null;
  }

  async #choose(kind: Kind | null): Promise<void> {
    this.#kind = kind;
    this.#tool?.remove();
    this.#tool = undefined;
    for (const [own, button] of this.#buttons) button.setAttribute("aria-pressed", String(own === kind));
    byId("hint").hidden = kind === null;
    if (kind === null) return;
    byId("hint").textContent = say(HINTS[kind]);
    try {
      const made = await import("./map3d-measure.mjs");
      if (this.#kind === kind) this.#tool = new made.measure({ kind }).addTo(this.#view);
    } catch (reason) {
      toast(`${say("noTool")}: ${String(reason)}`);
    }
  }
}

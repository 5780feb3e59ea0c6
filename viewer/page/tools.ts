import type { Map3D } from "./map3d.module.js";
import type { Measure } from "./map3d-measure.module.js";
import { byId, withText } from "./dom";
import { toast } from "./toast";
import { introduce, message } from "./i18n";

const KINDS = ["line", "height", "area", "profile"] as const;
type Kind = (typeof KINDS)[number];

/** Fingers tap, a mouse clicks. */
const hintOf = (kind: Kind): string =>
  message(`${kind}Hint`).replace("%", message(matchMedia("(pointer: coarse)").matches ? "tapOn" : "clickOn"));

/** The measuring tool: a button that opens it, the kinds, the results, and buttons that add a point, undo, clear and finish. */
export class Tools {
  readonly #view: Map3D;
  readonly #buttons: ReadonlyMap<Kind, HTMLElement>;
  #entry: typeof import("./map3d-measure.module.js") | undefined;
  #tool: Measure | undefined;
  #kind: Kind | null = null;
  /** The kind that is chosen first. */
  #last: Kind = "line";

  constructor(view: Map3D) {
    this.#view = view;
    this.#buttons = new Map(KINDS.map((kind) => [kind, byId(`measure-${kind}`)]));
    for (const [kind, button] of this.#buttons) button.addEventListener("click", () => void this.#activate(kind));
    byId("measure").hidden = false;
    const actions = {
      measure: () => void this.#activate(this.#last),
      "measure-add": () => this.#addPoint(),
      "measure-undo": () => this.#tool?.undo(),
      "measure-clear": () => this.#tool?.clear(),
      "measure-finish": () => this.#finish(),
    };
    for (const [id, act] of Object.entries(actions)) byId(id).addEventListener("click", act);
    // Before the tool's own listener, which would only clear the points.
    addEventListener(
      "keydown",
      (event) => {
        if (event.key !== "Escape" || !this.active || document.querySelector("dialog[open]")) return;
        event.stopPropagation();
        this.#finish();
      },
      true,
    );
  }

  /** True while clicks on the map belong to the tool. */
  get active(): boolean {
    return this.#kind !== null;
  }

  async #activate(kind: Kind | null): Promise<void> {
    if (kind !== null && kind === this.#kind) return;
    this.#kind = kind;
    this.#tool?.remove();
    this.#tool = undefined;
    this.#show();
    if (kind === null) return;
    this.#last = kind;
    try {
      // Once loaded, another kind takes the clicks at once.
      const entry = (this.#entry ??= await import("./map3d-measure.module.js"));
      if (this.#kind !== kind) return;
      const showResults = (): void => this.#showResults();
      this.#tool = new entry.measure({ kind })
        .on("change", showResults)
        .on("face", showResults)
        .on("profile", showResults)
        .addTo(this.#view);
    } catch (reason) {
      toast(introduce("toolFailed", reason));
    }
  }

  #finish(): void {
    void this.#activate(null);
    byId("measure").focus();
  }

  /** Adds the point under the cross in the middle of the map. */
  #addPoint(): void {
    const { clientWidth, clientHeight } = this.#view.container;
    this.#view.tap([clientWidth / 2, clientHeight / 2]);
  }

  #show(): void {
    const kind = this.#kind;
    byId("measuring").hidden = kind === null;
    byId("measure").setAttribute("aria-expanded", String(kind !== null));
    document.body.classList.toggle("measures", kind !== null);
    for (const [buttonKind, button] of this.#buttons) button.setAttribute("aria-pressed", String(buttonKind === kind));
    if (kind !== null) byId("hint").textContent = hintOf(kind);
    this.#showResults();
  }

  /** Shows the results in place of the hint, as soon as there are any; the hint then says what makes them doubtful. */
  #showResults(): void {
    const { results = [], warnings = [] } = this.#tool ?? {};
    byId("measured").replaceChildren(
      ...results.map(([name, value]) => {
        const row = document.createElement("div");
        row.append(withText("dt", name), withText("dd", value));
        return row;
      }),
    );
    byId("measured").hidden = results.length === 0;
    const warning = warnings.join(" ");
    if (this.#kind) byId("hint").textContent = warning || hintOf(this.#kind);
    byId("hint").hidden = results.length > 0 && !warning;
    for (const id of ["measure-undo", "measure-clear"]) (byId(id) as HTMLButtonElement).disabled = (this.#tool?.corners.length ?? 0) === 0;
  }
}

import { element } from "../core/dom";
import { clamp } from "../core/vec";
import { floorToRound } from "../core/lengths";
import type { Profile } from "./profile";
import type { MeasureMessages } from "./i18n";

const NS = "http://www.w3.org/2000/svg";
/** Size of the SVG view box, which is stretched to the element. */
const [WIDTH, HEIGHT] = [400, 100];
const GRID_LINES = 3;

/** Chart of a profile. A pointer or the arrow keys move a cursor along the line. */
export class ProfileChart {
  readonly box = element("div", "map3d-profile", { role: "slider", tabindex: "0" });
  readonly #svg = document.createElementNS(NS, "svg");
  readonly #heights = element("div", "map3d-profile-heights");
  readonly #readout = element("div", "map3d-profile-readout");
  readonly #cursor = element("div", "map3d-profile-cursor");
  readonly #onMove: (at: number | null) => void;
  #profile: Profile | undefined;
  #messages: MeasureMessages | undefined;
  #range: readonly [number, number] = [0, 1];
  #at: number | null = null;

  /** @param onMove called with the index of the sample at the cursor, null without a cursor */
  constructor(onMove: (at: number | null) => void) {
    this.#onMove = onMove;
    this.#svg.setAttribute("viewBox", `0 0 ${String(WIDTH)} ${String(HEIGHT)}`);
    this.#svg.setAttribute("preserveAspectRatio", "none");
    this.#svg.setAttribute("aria-hidden", "true");
    const field = element(
      "div",
      "map3d-profile-field",
      {},
      element("div", "map3d-profile-plot", {}, this.#svg, this.#cursor),
      this.#heights,
    );
    this.box.append(field, this.#readout);
    this.box.addEventListener("pointermove", ({ clientX }) => this.#moveTo(clientX));
    this.box.addEventListener("pointerdown", ({ clientX }) => this.#moveTo(clientX));
    this.box.addEventListener("pointerleave", () => this.#show(null));
    this.box.addEventListener("blur", () => this.#show(null));
    this.box.addEventListener("keydown", (event) => this.#onKeyDown(event));
    for (const type of ["pointerdown", "wheel", "click", "dblclick"]) this.box.addEventListener(type, (event) => event.stopPropagation());
  }

  /** Index of the sample at the cursor; null without a cursor. */
  get at(): number | null {
    return this.#at;
  }

  /** Shows a profile. @param prefix text before the length, such as "≈ " */
  set(profile: Profile, messages: MeasureMessages, prefix: string): void {
    [this.#profile, this.#messages, this.#at] = [profile, messages, null];
    const known = [...profile.heights_m].filter((height) => !Number.isNaN(height));
    const [low, high] = known.length > 0 ? [Math.min(...known), Math.max(...known)] : [0, 1];
    const margin = Math.max(0.08 * (high - low), 0.5);
    this.#range = [low - margin, high + margin];
    this.#svg.replaceChildren(
      ...this.#grid(messages),
      path("map3d-profile-fill", this.#shape(true)),
      path("map3d-profile-line", this.#shape(false)),
    );
    const length = profile.distances_m.at(-1) ?? 0;
    const text =
      known.length > 0
        ? `${prefix}${messages.length(length)}  ${messages.range(low, high)}${known.length < profile.heights_m.length ? `  ${messages.partHidden}` : ""}`
        : messages.allHidden;
    for (const [name, value] of Object.entries({
      "aria-label": messages.profile,
      "aria-valuemin": "0",
      "aria-valuemax": length.toFixed(2),
      "aria-valuenow": "0",
      "aria-valuetext": text,
    }))
      this.box.setAttribute(name, value);
    this.box.dataset["summary"] = text;
    this.#show(null);
  }

  #grid(messages: MeasureMessages): SVGElement[] {
    const [low, high] = this.#range;
    const step =
      floorToRound((high - low) / GRID_LINES) * ((high - low) / GRID_LINES / floorToRound((high - low) / GRID_LINES) >= 2 ? 2 : 1);
    const heights = Array.from(
      { length: Math.max(0, Math.floor(high / step) - Math.ceil(low / step) + 1) },
      (_, k) => (Math.ceil(low / step) + k) * step,
    );
    this.#heights.replaceChildren(
      ...heights.map((height) => {
        const label = element("span", "", {}, messages.height(height));
        label.style.top = `${this.#y(height).toFixed(1)}%`;
        return label;
      }),
    );
    return heights.map((height) => path("map3d-profile-grid", `M0 ${this.#y(height).toFixed(2)}H${String(WIDTH)}`));
  }

  /** Returns an SVG path with one part for each visible stretch of the line. */
  #shape(filled: boolean): string {
    const { heights_m = new Float64Array() } = this.#profile ?? {};
    let [shape, start] = ["", -1];
    for (let k = 0; k <= heights_m.length; k++) {
      const height = heights_m[k] ?? NaN;
      if (!Number.isNaN(height)) {
        const at = `${this.#x(k).toFixed(2)} ${this.#y(height).toFixed(2)}`;
        shape += start < 0 ? (filled ? `M${this.#x(k).toFixed(2)} ${String(HEIGHT)}L${at}` : `M${at}`) : `L${at}`;
        if (start < 0) start = k;
      } else if (start >= 0) {
        if (filled) shape += `L${this.#x(k - 1).toFixed(2)} ${String(HEIGHT)}Z`;
        start = -1;
      }
    }
    return shape;
  }

  #x(k: number): number {
    return (WIDTH * k) / Math.max((this.#profile?.heights_m.length ?? 1) - 1, 1);
  }

  #y(height: number): number {
    const [low, high] = this.#range;
    return (HEIGHT * (high - height)) / (high - low);
  }

  #moveTo(clientX: number): void {
    const { left, width } = this.#svg.getBoundingClientRect();
    const last = (this.#profile?.heights_m.length ?? 0) - 1;
    if (last > 0 && width > 0) this.#show(clamp(Math.round((last * (clientX - left)) / width), 0, last));
  }

  #onKeyDown(event: KeyboardEvent): void {
    const last = (this.#profile?.heights_m.length ?? 0) - 1;
    const step = Math.max(1, Math.round(last / 100));
    const to: Record<string, number> = { ArrowLeft: (this.#at ?? step) - step, ArrowRight: (this.#at ?? -step) + step, Home: 0, End: last };
    const at = to[event.key];
    if (at === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    this.#show(clamp(at, 0, last));
  }

  #show(at: number | null): void {
    const [profile, messages] = [this.#profile, this.#messages];
    if (!profile || !messages) return;
    this.#at = at;
    this.#cursor.hidden = at === null;
    const text =
      at === null ? (this.box.dataset["summary"] ?? "") : messages.formatSample(profile.distances_m[at] ?? 0, profile.heights_m[at] ?? NaN);
    this.#readout.textContent = text;
    if (at !== null) {
      this.#cursor.style.left = `${((100 * this.#x(at)) / WIDTH).toFixed(2)}%`;
      this.box.setAttribute("aria-valuenow", (profile.distances_m[at] ?? 0).toFixed(2));
      this.box.setAttribute("aria-valuetext", text);
    }
    this.#onMove(at);
  }
}

function path(classes: string, d: string): SVGPathElement {
  const element = document.createElementNS(NS, "path");
  element.setAttribute("class", classes);
  element.setAttribute("d", d);
  return element;
}

import { element } from "../core/dom";
import { getMapMessages } from "../core/i18n";
import type { FilledOptions } from "./options";

const HINT_MS = 1600;

/** A map in a page that scrolls: leaves the wheel and one finger to the page, and says what moves the map. */
export class Cooperation {
  readonly #container: HTMLElement;
  readonly #mode: FilledOptions["gestureHandling"];
  readonly #language: string;
  readonly #hint = element("p", "map3d-hint", { "aria-hidden": "true" });
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(container: HTMLElement, mode: FilledOptions["gestureHandling"], language: string) {
    this.#container = container;
    this.#mode = mode;
    this.#language = language;
    container.classList.toggle("map3d-cooperative", mode !== "greedy");
  }

  /** Whether the page has the wheel and one finger now. */
  get isActive(): boolean {
    if (this.#mode === "greedy" || document.fullscreenElement?.contains(this.#container)) return false;
    const { scrollHeight, clientHeight } = document.scrollingElement ?? document.documentElement;
    return this.#mode === "cooperative" || scrollHeight > clientHeight || window !== window.parent;
  }

  /** Says for a moment which gesture moves the map. */
  showHint(touch: boolean): void {
    const { twoFingers, wheelWithKey } = getMapMessages(this.#language);
    this.#hint.textContent = touch ? twoFingers : wheelWithKey(/mac|iphone|ipad/i.test(navigator.platform) ? "⌘" : "Ctrl");
    this.#container.append(this.#hint);
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#hint.remove(), HINT_MS);
  }

  destroy(): void {
    clearTimeout(this.#timer);
    this.#hint.remove();
    this.#container.classList.remove("map3d-cooperative");
  }
}

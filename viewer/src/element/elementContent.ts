import { css } from "../core/css";
import { element } from "../core/dom";
import { findLanguage } from "../core/i18n";
import { getElementMessages } from "./i18n";

const STYLES = css`
  :host {
    display: block;
    position: relative;
    height: 24rem;
  }
  :host([hidden]),
  slot[hidden] {
    display: none;
  }
  ::slotted([slot="map"]) {
    position: absolute;
    inset: 0;
  }
`;

/** Shows the map, or the fallback content of the element when no map can be drawn. Style sheets of the page apply to both. */
export class ElementContent {
  readonly #host: HTMLElement;
  readonly #map = element("slot", "", { name: "map" });
  readonly #fallback = element("slot", "", {});
  #container: HTMLElement | null = null;

  constructor(host: HTMLElement) {
    this.#host = host;
    const root = host.attachShadow({ mode: "open" });
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(STYLES);
    root.adoptedStyleSheets = [sheet];
    root.append(this.#map, this.#fallback);
  }

  /** Creates the container of a new map. */
  createContainer(language: string | undefined): HTMLElement {
    const label = this.#host.getAttribute("label") ?? getElementMessages(language ?? findLanguage(this.#host)).map;
    this.#container = element("div", "", { slot: "map", role: "group", "aria-label": label });
    this.#host.append(this.#container);
    return this.#container;
  }

  clear(): void {
    this.#container?.remove();
    this.#container = null;
  }

  /** Shows the map, else the fallback content, else an error message. */
  show(drawn: boolean, language: string): void {
    const showFallback = !drawn && this.#fallback.assignedNodes().some((node) => node.textContent?.trim());
    [this.#map.hidden, this.#fallback.hidden] = [showFallback, !showFallback];
    const error = this.#container?.querySelector(":scope > .map3d-message");
    if (drawn) error?.remove();
    else if (!error) this.#container?.append(element("p", "map3d-message", { role: "alert" }, getElementMessages(language).failed));
  }
}

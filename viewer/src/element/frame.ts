import { element } from "../core/dom";
import { findLanguage } from "../core/i18n";
import { getElementMessages } from "./i18n";

const STYLES = `
:host { display: block; position: relative; height: 24rem; }
:host([hidden]), slot[hidden] { display: none; }
::slotted([slot="map"]) { position: absolute; inset: 0; }
`;

/** The element's two sides: the map, or what its author has put inside for when there is none. The page's style sheets reach both. */
export class Frame {
  readonly #host: HTMLElement;
  readonly #map = element("slot", "", { name: "map" });
  readonly #rest = element("slot", "", {});
  #ground: HTMLElement | null = null;

  constructor(host: HTMLElement) {
    this.#host = host;
    const root = host.attachShadow({ mode: "open" });
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(STYLES);
    root.adoptedStyleSheets = [sheet];
    root.append(this.#map, this.#rest);
  }

  /** An element for a new map. */
  lay(language: string | undefined): HTMLElement {
    const label = this.#host.getAttribute("label") ?? getElementMessages(language ?? findLanguage(this.#host)).map;
    this.#ground = element("div", "", { slot: "map", role: "group", "aria-label": label });
    this.#host.append(this.#ground);
    return this.#ground;
  }

  clear(): void {
    this.#ground?.remove();
    this.#ground = null;
  }

  /** Shows the map; else what is inside, or a sentence of ours when there is nothing. */
  show(drawn: boolean, language: string): void {
    const instead = !drawn && this.#rest.assignedNodes().some((node) => node.textContent?.trim());
    [this.#map.hidden, this.#rest.hidden] = [instead, !instead];
    const said = this.#ground?.querySelector(":scope > .map3d-message");
    if (drawn) said?.remove();
    else if (!said) this.#ground?.append(element("p", "map3d-message", { role: "alert" }, getElementMessages(language).failed));
  }
}

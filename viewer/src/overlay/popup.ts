import { element, iconButton } from "../core/dom";
import { Evented } from "../core/events";
import { getMapMessages } from "../core/i18n";
import type { Addable, LayerHost, OverlayHost } from "../core/overlayHost";
import type { Vec3 } from "../core/vec";

/** How a popup looks. */
export interface PopupOptions {
  /** Pixels above the position. Default 14. */
  offset_px?: number;
  /** Shows a button that closes it. Default true. */
  closeButton?: boolean;
}

/** What a popup fires. */
export interface PopupEvents {
  /** It came onto a map. */
  open: object;
  /** It left its map, by its button, Escape or a script. */
  close: object;
}

const CLOSE = "M6 6l12 12M18 6L6 18";

/** A box with text or DOM content that points at a position (world coordinates). */
export class popup extends Evented<PopupEvents> implements Addable<OverlayHost> {
  readonly options: Required<PopupOptions>;
  readonly #box: HTMLElement;
  readonly #body: HTMLElement;
  #position: Vec3;
  #map: (OverlayHost & Partial<LayerHost<OverlayHost>>) | undefined;
  #place = (): void => {
    this.#update();
  };

  constructor(content: string | Node, position: Vec3 = [0, 0, 0], options: PopupOptions = {}) {
    super();
    this.options = { offset_px: 14, closeButton: true, ...options };
    this.#position = position;
    this.#body = element("div", "map3d-popup-body");
    this.#box = element("div", "map3d-popup", { role: "dialog" }, this.#body);
    if (this.options.closeButton) this.#addCloseButton();
    this.setContent(content);
  }

  /** Opens it on a map. */
  addTo(map: LayerHost<OverlayHost>): this {
    map.add(this);
    return this;
  }

  /** Closes it. */
  remove(): this {
    this.#map?.discard?.(this);
    return this;
  }

  /** It is on a map. */
  get isOpen(): boolean {
    return this.#map !== undefined;
  }

  /** Text is shown as text, never as HTML. */
  setContent(content: string | Node): this {
    this.#body.replaceChildren(content);
    return this;
  }

  /** World coordinates. */
  setPosition(position: Vec3): this {
    this.#position = position;
    this.#update();
    return this;
  }

  attachTo(map: OverlayHost): void {
    this.#map = map;
    const { details, close } = getMapMessages(map.language);
    this.#box.setAttribute("aria-label", details);
    const button = this.#box.querySelector(".map3d-popup-close");
    for (const name of ["aria-label", "title"]) button?.setAttribute(name, close);
    map.overlayPane.append(this.#box);
    map.frameEvents.on("move", this.#place);
    this.#update();
    this.fire("open", {});
  }

  detachFrom(map: OverlayHost): void {
    map.frameEvents.off("move", this.#place);
    this.#box.remove();
    this.#map = undefined;
    this.fire("close", {});
  }

  #addCloseButton(): void {
    const button = iconButton("map3d-popup-close", "", CLOSE);
    button.addEventListener("click", () => this.remove());
    this.#box.append(button);
    this.#box.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.remove();
    });
  }

  #update(): void {
    const at = this.#map?.project(this.#position);
    this.#box.hidden = !at;
    if (at) this.#box.style.transform = `translate(${at[0].toFixed(1)}px, ${(at[1] - this.options.offset_px).toFixed(1)}px) translate(-50%, -100%)`;
  }
}

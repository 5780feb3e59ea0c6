import { element, iconButton } from "../core/dom";
import { getMapMessages } from "../core/i18n";
import { fillOptions, optionOr, type FilledOptionsOf, type OptionsOf } from "../core/options";
import type { OverlayHost } from "../core/overlayHost";
import type { AnyPosition } from "../core/position";
import type { Vec3 } from "../core/vec";
import { PositionedLayer } from "./positionedLayer";

const POPUP_OPTIONS = {
  /** Distance above the position, CSS pixels. Default 14. */
  offset_px: optionOr<number>(14),
  /** Shows a close button. Default true. */
  closeButton: optionOr<boolean>(true),
};

/** Options of a popup. */
export interface PopupOptions extends OptionsOf<typeof POPUP_OPTIONS> {}

/** Events of a popup. */
export interface PopupEvents {
  /** It was added to a map. */
  open: object;
  /** It was removed: by its button, Escape or a script. */
  close: object;
}

const CLOSE = "M6 6l12 12M18 6L6 18";

/** A box with text or DOM content that points at a position (world coordinates). */
export class Popup extends PositionedLayer<PopupEvents> {
  readonly options: FilledOptionsOf<typeof POPUP_OPTIONS>;
  readonly #box: HTMLElement;
  readonly #body: HTMLElement;

  constructor(content: string | Node, position: AnyPosition = [0, 0, 0], options: PopupOptions = {}) {
    super(position);
    this.options = fillOptions(POPUP_OPTIONS, options);
    this.#body = element("div", "map3d-popup-body");
    this.#box = element("div", "map3d-popup", { role: "dialog" }, this.#body);
    if (this.options.closeButton) this.#addCloseButton();
    this.setContent(content);
  }

  protected override get eventTypes(): readonly (keyof PopupEvents)[] {
    return ["open", "close"];
  }

  /** Whether it is on a map. */
  get isOpen(): boolean {
    return this.map !== undefined;
  }

  /** Sets the content; strings are shown as text, never as HTML. */
  setContent(content: string | Node): this {
    this.#body.replaceChildren(content);
    return this;
  }

  /** @internal */
  override detachFrom(map: OverlayHost): void {
    super.detachFrom(map);
    this.fire("close", {}); // no longer on the map, so that a listener may open it again
  }

  protected onAdd(map: OverlayHost): void {
    const { details, close } = getMapMessages(map.language);
    this.#box.setAttribute("aria-label", details);
    const button = this.#box.querySelector(".map3d-popup-close");
    for (const name of ["aria-label", "title"]) button?.setAttribute(name, close);
    this.showElement(map, this.#box, "move");
    this.fire("open", {});
  }

  protected override onRemove(map: OverlayHost): void {
    super.onRemove(map);
    this.#box.remove();
  }

  protected placeElement(map: OverlayHost, position: Vec3 | null): void {
    const at = position && map.project(position);
    this.#box.hidden = !at;
    if (at)
      this.#box.style.transform = `translate(${at[0].toFixed(1)}px, ${(at[1] - this.options.offset_px).toFixed(1)}px) translate(-50%, -100%)`;
  }

  #addCloseButton(): void {
    const button = iconButton("map3d-popup-close", "", CLOSE);
    button.addEventListener("click", () => this.remove());
    this.#box.append(button);
    this.#box.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.remove();
    });
  }
}

import { element } from "../core/dom";
import { Evented } from "../core/events";
import type { Attachable, Holder, Surface } from "../core/surface";
import type { Vec3 } from "../core/vec";
import { popup, type PopupOptions } from "./popup";

/** How a marker looks. */
export interface MarkerOptions {
  /** Any CSS colour; default the map's accent. */
  color?: string;
  /** false: the label shows only under the pointer or focus. Default true. */
  showLabel?: boolean;
}

/** What a marker fires. */
export interface MarkerEvents {
  /** Clicked, tapped, or Enter pressed. */
  click: { marker: marker };
  /** Became the selected one. */
  select: { marker: marker };
  /** Is no longer the selected one. */
  deselect: { marker: marker };
}

/** A labelled 3D position (coordinates of the scene's CRS). */
export class marker extends Evented<MarkerEvents> implements Attachable<Surface> {
  readonly options: Required<Omit<MarkerOptions, "color">> & Pick<MarkerOptions, "color">;
  readonly #button: HTMLButtonElement;
  readonly #text: HTMLElement;
  #label: string;
  #position: Vec3;
  #popup: popup | undefined;
  #map: (Surface & Partial<Holder<Surface>>) | undefined;
  #selected = false;
  #place = (): void => {
    this.#update();
  };

  constructor(label: string, position: Vec3, options: MarkerOptions = {}) {
    super();
    this.options = { showLabel: true, ...options };
    this.#label = label;
    this.#position = position;
    this.#text = element("span", "map3d-marker-label", {}, label);
    this.#button = element("button", "map3d-marker", { type: "button", "aria-label": label }, element("span", "map3d-marker-stem"), this.#text);
    this.#button.classList.toggle("map3d-marker-quiet", !this.options.showLabel);
    if (options.color !== undefined) this.#button.style.setProperty("--map3d-marker", options.color);
    this.#button.addEventListener("click", () => {
      this.#clicked();
    });
  }

  /** Puts it on a map. */
  addTo(map: Holder<Surface>): this {
    map.add(this);
    return this;
  }

  /** Takes it off its map, with its popup. */
  remove(): this {
    this.#map?.discard?.(this);
    return this;
  }

  /** What it is called. */
  get label(): string {
    return this.#label;
  }

  /** World coordinates. */
  get position(): Vec3 {
    return this.#position;
  }

  /** One marker of a map is, at most. */
  get selected(): boolean {
    return this.#selected;
  }

  /** Text, never HTML. */
  setLabel(label: string): this {
    this.#label = label;
    this.#text.textContent = label;
    this.#button.setAttribute("aria-label", label);
    return this;
  }

  /** World coordinates; its popup follows. */
  setPosition(position: Vec3): this {
    this.#position = position;
    this.#popup?.setPosition(position);
    this.#update();
    return this;
  }

  /** Content that opens above the marker when it is clicked. */
  bindPopup(content: string | Node, options: PopupOptions = {}): this {
    this.#popup?.remove();
    this.#popup = new popup(content, this.#position, { offset_px: this.options.showLabel ? 58 : 14, ...options });
    return this;
  }

  /** Nothing when it has none, or is on no map. */
  openPopup(): this {
    if (this.#map?.add && this.#popup && !this.#popup.isOpen) this.#popup.addTo(this.#map as Holder<Surface>);
    return this;
  }

  /** Nothing when none is open. */
  closePopup(): this {
    this.#popup?.remove();
    return this;
  }

  /** Makes it the selected one, or no longer. */
  select(selected = true): this {
    if (selected === this.#selected) return this;
    this.#selected = selected;
    this.#button.classList.toggle("map3d-marker-selected", selected);
    this.#button.setAttribute("aria-pressed", String(selected));
    return this.fire(selected ? "select" : "deselect", { marker: this });
  }

  onAdd(map: Surface): void {
    this.#map = map;
    map.overlayPane.append(this.#button);
    map.moves.on("move", this.#place);
    this.#update();
  }

  onRemove(map: Surface): void {
    map.moves.off("move", this.#place);
    this.#popup?.remove();
    this.#button.remove();
    this.#map = undefined;
  }

  #clicked(): void {
    this.fire("click", { marker: this });
    this.select();
    if (this.#popup?.isOpen) this.closePopup();
    else this.openPopup();
  }

  #update(): void {
    const at = this.#map?.project(this.#position);
    const pane = this.#map?.container;
    const seen = at && pane && at[0] > -80 && at[1] > -10 && at[0] < pane.clientWidth + 80 && at[1] < pane.clientHeight + 80;
    this.#button.hidden = !seen;
    if (seen) this.#button.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px)`;
  }
}

import { element } from "../core/dom";
import { Evented } from "../core/events";
import type { Addable, LayerHost, OverlayHost } from "../core/overlayHost";
import type { Vec2, Vec3 } from "../core/vec";
import { listenToDrags } from "./drag";
import { popup, type PopupOptions } from "./popup";

/** How a marker looks. */
export interface MarkerOptions {
  /** Any CSS colour; default the map's accent. */
  color?: string;
  /** false: the label shows only under the pointer or focus. Default true. */
  showLabel?: boolean;
  /** Stands with its middle at the position, in place of the dot. Text is shown as text. */
  icon?: string | Node;
  /** What becomes of it behind a building: nothing, pale, or not shown. Default "none". */
  occlusion?: "none" | "fade" | "hide";
  /** Can be moved over the surface, by hand or, when it has the focus, by arrow keys (with Shift in small steps). Default false. */
  draggable?: boolean;
}

/** What a marker fires. */
export interface MarkerEvents {
  /** Clicked, tapped, or Enter pressed. */
  click: { marker: marker };
  /** Became the selected one. */
  select: { marker: marker };
  /** Is no longer the selected one. */
  deselect: { marker: marker };
  dragstart: { marker: marker };
  /** Moved by hand or keys. */
  drag: { marker: marker; position: Vec3 };
  dragend: { marker: marker; position: Vec3 };
}

/** A labelled 3D position (coordinates of the scene's CRS). */
export class marker extends Evented<MarkerEvents> implements Addable<OverlayHost> {
  readonly options: Required<Omit<MarkerOptions, "color" | "icon">> & Pick<MarkerOptions, "color" | "icon">;
  readonly needs: readonly "depth"[];
  #button: HTMLButtonElement | undefined;
  #label: string;
  #position: Vec3;
  #shift: Vec2 = [0, 0];
  #popup: popup | undefined;
  #map: (OverlayHost & Partial<LayerHost<OverlayHost>>) | undefined;
  #selected = false;
  #place = (): void => {
    this.#update();
  };

  constructor(label: string, position: Vec3, options: MarkerOptions = {}) {
    super();
    this.options = { showLabel: true, occlusion: "none", draggable: false, ...options };
    this.needs = this.options.draggable || this.options.occlusion !== "none" ? ["depth"] : [];
    this.#label = label;
    this.#position = position;
  }

  /** Puts it on a map. */
  addTo(map: LayerHost<OverlayHost>): this {
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
    this.#dress();
    return this;
  }

  /** World coordinates; its popup follows. */
  setPosition(position: Vec3): this {
    this.#position = position;
    this.#popup?.setPosition(position);
    this.#update();
    return this;
  }

  /** @internal Shown so many CSS pixels beside its position. */
  setOffset(shift: Vec2): this {
    this.#shift = shift;
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
    if (this.#map?.add && this.#popup && !this.#popup.isOpen) this.#popup.addTo(this.#map as LayerHost<OverlayHost>);
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
    this.#dress();
    return this.fire(selected ? "select" : "deselect", { marker: this });
  }

  attachTo(map: OverlayHost): void {
    this.#map = map;
    this.#button = this.#made(map);
    this.#dress();
    map.overlayPane.append(this.#button);
    map.frameEvents.on(this.options.occlusion === "none" ? "move" : "draw", this.#place);
    this.#update();
  }

  detachFrom(map: OverlayHost): void {
    map.frameEvents.off("move", this.#place).off("draw", this.#place);
    this.#popup?.remove();
    this.#button?.remove();
    this.#button = this.#map = undefined;
  }

  #made(map: OverlayHost): HTMLButtonElement {
    const { color, icon, showLabel, draggable } = this.options;
    const button = element("button", "map3d-marker", { type: "button" }, icon === undefined ? element("span", "map3d-marker-stem") : element("span", "map3d-marker-icon", {}, icon), element("span", "map3d-marker-label"));
    button.classList.toggle("map3d-marker-quiet", !showLabel);
    if (color !== undefined) button.style.setProperty("--map3d-marker", color);
    button.addEventListener("click", () => { this.#clicked(); });
    if (draggable) listenToDrags(button, map, () => this.#position, (type, position) => { this.#dragged(type, position); });
    return button;
  }

  #dress(): void {
    const button = this.#button;
    if (!button) return;
    (button.lastChild as HTMLElement).textContent = this.#label;
    button.setAttribute("aria-label", this.#label);
    button.classList.toggle("map3d-marker-selected", this.#selected);
    button.setAttribute("aria-pressed", String(this.#selected));
  }

  #clicked(): void {
    this.fire("click", { marker: this });
    this.select();
    if (this.#popup?.isOpen) this.closePopup();
    else this.openPopup();
  }

  #dragged(type: "dragstart" | "drag" | "dragend", position: Vec3): void {
    if (type === "drag") this.setPosition(position);
    this.fire(type, { marker: this, position });
  }

  #update(): void {
    const [button, map] = [this.#button, this.#map];
    const at = map?.project(this.#position);
    if (!button || !map) return;
    const behind = this.options.occlusion !== "none" && map.isOccluded(this.#position);
    const { clientWidth, clientHeight } = map.container;
    const seen = at && at[0] > -80 && at[1] > -10 && at[0] < clientWidth + 80 && at[1] < clientHeight + 80;
    button.hidden = !seen || (behind && this.options.occlusion === "hide");
    button.classList.toggle("map3d-marker-behind", behind);
    if (at) button.style.transform = `translate(${(at[0] + this.#shift[0]).toFixed(1)}px, ${(at[1] + this.#shift[1]).toFixed(1)}px)`;
  }
}

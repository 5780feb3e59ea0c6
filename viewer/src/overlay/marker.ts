import { element } from "../core/dom";
import { getPlugin } from "../core/plugins";
import { fillOptions, option, optionOr, type FilledOptionsOf, type OptionsOf } from "../core/options";
import type { EnableDragging, OverlayHost } from "../core/overlayHost";
import type { AnyPosition } from "../core/position";
import type { Vec2, Vec3 } from "../core/vec";
import { Popup, type PopupOptions } from "./popup";
import { PositionedLayer } from "./positionedLayer";

const MARKER_OPTIONS = {
  /** Any CSS colour; default: the map's accent colour. */
  color: option<string>(),
  /** false: the label shows only while the marker is hovered or focused. Default true. */
  showLabel: optionOr<boolean>(true),
  /** Replaces the dot, centred on the position. Strings are shown as text. Default: a dot. */
  icon: option<string | Node>(),
  /** What happens while the marker is behind a building: nothing, it fades, or it hides. Default "none". */
  occlusion: optionOr<"none" | "fade" | "hide">("none"),
  /** Can be dragged over the surface or, while focused, moved with the arrow keys (with Shift in small steps); needs the entry `drag`. Default false. */
  draggable: optionOr<boolean>(false),
};

/** Options of a marker. */
export interface MarkerOptions extends OptionsOf<typeof MARKER_OPTIONS> {}

/** Events of a marker. */
export interface MarkerEvents {
  /** Clicked, tapped, or Enter pressed. */
  click: { marker: Marker };
  select: { marker: Marker };
  deselect: { marker: Marker };
  dragstart: { marker: Marker };
  /** Moved by the pointer or the keyboard. */
  drag: { marker: Marker; position: Vec3 };
  dragend: { marker: Marker; position: Vec3 };
}

/** A labelled position. */
export class Marker extends PositionedLayer<MarkerEvents> {
  readonly options: FilledOptionsOf<typeof MARKER_OPTIONS>;
  readonly needs: readonly "depth"[];
  #button: HTMLButtonElement | undefined;
  #label: string;
  #place: AnyPosition;
  #offset: Vec2 = [0, 0];
  #popup: Popup | undefined;
  #selected = false;

  /** @throws UsageError for anything but a position, or an unknown option */
  constructor(label: string, position: AnyPosition, options: MarkerOptions = {}) {
    super(position);
    this.options = fillOptions(MARKER_OPTIONS, options);
    if (this.options.draggable) getPlugin("drag", "draggable");
    this.needs = this.options.draggable || this.options.occlusion !== "none" ? ["depth"] : [];
    [this.#label, this.#place] = [label, position];
  }

  protected override get eventTypes(): readonly (keyof MarkerEvents)[] {
    return ["click", "select", "deselect", "dragstart", "drag", "dragend"];
  }

  /** Label text. */
  get label(): string {
    return this.#label;
  }

  /** Whether it is selected; at most one marker per map is. */
  get selected(): boolean {
    return this.#selected;
  }

  /** Sets the label: text, never HTML. */
  setLabel(label: string): this {
    this.#label = label;
    this.#updateButton();
    return this;
  }

  /** Sets the position; its popup follows. */
  override setPosition(position: AnyPosition): this {
    super.setPosition(position);
    this.#place = position;
    this.#popup?.setPosition(position);
    return this;
  }

  /** @internal Shows it this many CSS pixels away from its position. */
  setOffset(offset: Vec2): this {
    this.#offset = offset;
    return this.setPosition(this.#place);
  }

  /** Opens a popup with this content above the marker when it is clicked. */
  bindPopup(content: string | Node, options: PopupOptions = {}): this {
    this.#popup?.remove();
    this.#popup = new Popup(content, this.#place, { offset_px: this.options.showLabel ? 58 : 14, ...options });
    return this;
  }

  /** Opens its popup; does nothing if it has none or is not on a map. */
  openPopup(): this {
    if (this.map && this.#popup && !this.#popup.isOpen) this.#popup.addTo(this.map);
    return this;
  }

  /** Closes its popup; does nothing if none is open. */
  closePopup(): this {
    this.#popup?.remove();
    return this;
  }

  /** Selects or deselects it. */
  select(selected = true): this {
    if (selected === this.#selected) return this;
    this.#selected = selected;
    this.#updateButton();
    return this.fire(selected ? "select" : "deselect", { marker: this });
  }

  protected onAdd(map: OverlayHost): void {
    this.#button = this.#createButton(map);
    this.#updateButton();
    this.showElement(map, this.#button, this.options.occlusion === "none" ? "move" : "draw");
  }

  protected override onRemove(map: OverlayHost): void {
    super.onRemove(map);
    this.#popup?.remove();
    this.#button?.remove();
    this.#button = undefined;
  }

  protected placeElement(map: OverlayHost, position: Vec3 | null): void {
    const [button, at] = [this.#button, position && map.project(position)];
    if (!button) return;
    const occluded = this.options.occlusion !== "none" && position !== null && map.isOccluded(position);
    const { clientWidth, clientHeight } = map.container;
    const inView = at && at[0] > -80 && at[1] > -10 && at[0] < clientWidth + 80 && at[1] < clientHeight + 80;
    button.hidden = !inView || (occluded && this.options.occlusion === "hide");
    button.classList.toggle("map3d-marker-occluded", occluded);
    if (at) button.style.transform = `translate(${(at[0] + this.#offset[0]).toFixed(1)}px, ${(at[1] + this.#offset[1]).toFixed(1)}px)`;
  }

  #createButton(map: OverlayHost): HTMLButtonElement {
    const { color, icon, showLabel, draggable } = this.options;
    const button = element(
      "button",
      "map3d-marker",
      { type: "button" },
      icon === undefined ? element("span", "map3d-marker-stem") : element("span", "map3d-marker-icon", {}, icon),
      element("span", "map3d-marker-label"),
    );
    button.classList.toggle("map3d-marker-hover-label", !showLabel);
    if (color !== undefined) button.style.setProperty("--map3d-marker", color);
    button.addEventListener("click", () => this.#onClick());
    if (draggable)
      (getPlugin("drag", "draggable") as EnableDragging)(
        button,
        map,
        () => this.position,
        (type, position) => this.#onDrag(type, position),
      );
    return button;
  }

  #updateButton(): void {
    const button = this.#button;
    if (!button) return;
    (button.lastChild as HTMLElement).textContent = this.#label;
    button.setAttribute("aria-label", this.#label);
    button.classList.toggle("map3d-marker-selected", this.#selected);
    button.setAttribute("aria-pressed", String(this.#selected));
  }

  #onClick(): void {
    this.fire("click", { marker: this });
    this.select();
    if (this.#popup?.isOpen) this.closePopup();
    else this.openPopup();
  }

  #onDrag(type: "dragstart" | "drag" | "dragend", position: Vec3): void {
    if (type === "drag") this.setPosition(position);
    this.fire(type, { marker: this, position });
  }
}

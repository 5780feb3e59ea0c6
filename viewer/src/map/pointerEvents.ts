import { asError } from "../core/errors";
import type { Vec2 } from "../core/vec";
import type { ClickEvent, MapEvents } from "./options";
import { EMPTY_PICK, type Pick } from "./picker";

/** A map as seen by its pointer events. */
export interface PickedMap {
  pick(point: Vec2): Promise<Pick>;
  pickLoaded(point: Vec2): Pick | null;
  fire<K extends "preclick" | "click" | "mousemove">(type: K, event: MapEvents[K]): unknown;
  report(error: Error): void;
}

/** Turns taps and movements of the pointer into a map's events, with the object under them. */
export class PointerEvents {
  readonly #map: PickedMap;
  #clickCount = 0;
  #hoverPoint: Vec2 | null = null;

  constructor(map: PickedMap) {
    this.#map = map;
  }

  /** Remembers a position of the pointer for the next frame. */
  hover(point: Vec2): void {
    this.#hoverPoint = point;
  }

  /** Fires the event of the last position. */
  flush(): void {
    const point = this.#hoverPoint;
    this.#hoverPoint = null;
    if (point) this.#map.fire("mousemove", { ...(this.#map.pickLoaded(point) ?? EMPTY_PICK), point });
  }

  /** Ends clicks whose values are being fetched. */
  stop(): void {
    this.#clickCount++;
  }

  async click(point: Vec2): Promise<void> {
    const clickNumber = ++this.#clickCount;
    this.#map.fire("preclick", { ...(this.#map.pickLoaded(point) ?? { ...EMPTY_PICK, approximate: true }), point });
    const pick = await this.#map.pick(point);
    const event = await this.#addAttributes({ ...pick, point });
    if (clickNumber === this.#clickCount) this.#map.fire("click", event);
  }

  async #addAttributes(event: ClickEvent): Promise<ClickEvent> {
    try {
      const object = await event.layer?.object(event.id);
      return object ? { ...event, name: object.name, class: object.class, attributes: object.attributes } : event;
    } catch (reason) {
      this.#map.report(asError(reason));
      return event;
    }
  }
}

import { asError } from "../core/errors";
import type { Vec2 } from "../core/vec";
import type { ClickEvent, HoverEvent, MapEvents } from "./options";
import { EMPTY_PICK, type Pick } from "./picker";

/** A map as seen by its pointer events. */
export interface PickedMap {
  pick(point: Vec2): Promise<Pick>;
  pickLoaded(point: Vec2): Pick | null;
  fire<K extends "preclick" | "click" | "mousemove">(type: K, event: MapEvents[K]): unknown;
  report(error: Error): void;
}

/** Turns taps and movements of the pointer into events of a map and of its layers, with the object under them. */
export class PointerEvents {
  readonly #map: PickedMap;
  #clickCount = 0;
  /** Position of the pointer since the last frame; null: it has left the map. */
  #point: Vec2 | null | undefined;
  /** What is under the pointer. */
  #hovered: HoverEvent | undefined;

  constructor(map: PickedMap) {
    this.#map = map;
  }

  /** Remembers a position of the pointer for the next frame; null: it has left the map. */
  hover(point: Vec2 | null): void {
    this.#point = point;
  }

  /** Fires the events of the last position. */
  flush(): void {
    const [point, before] = [this.#point, this.#hovered];
    if (point === undefined) return;
    const event = { ...((point && this.#map.pickLoaded(point)) ?? EMPTY_PICK), point: point ?? [0, 0] } as const;
    this.#point = undefined;
    this.#hovered = event;
    if (point) this.#map.fire("mousemove", event);
    if (before?.layer !== event.layer || before.id !== event.id) {
      if (before?.id) before.layer?.fire("mouseout", before);
      if (event.id) event.layer?.fire("mouseover", event);
    }
    if (event.id) event.layer?.fire("mousemove", event);
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
    if (clickNumber !== this.#clickCount) return;
    this.#map.fire("click", event);
    if (event.id) event.layer?.fire("click", event);
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

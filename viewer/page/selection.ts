import type { ClickEvent, imageLayer, map, Vec3 } from "./map3d.mjs";
import type { InfoPanel } from "./info";
import { toast } from "./messages";
import { readPlace, writePlace } from "./place";

const QUIET = new Set(["terrain", "ground"]);
/** Addresses may not be changed as often as a slider moves. */
const ADDRESS_MS = 400;

/** The chosen object: highlighted, described, and kept in the address with the view and the time. The back button goes from choice to choice. */
export class Selection {
  readonly #view: map;
  readonly #layer: imageLayer;
  readonly #info: InfoPanel;
  #id = 0;
  #timer = 0;

  constructor(view: map, layer: imageLayer, info: InfoPanel) {
    [this.#view, this.#layer, this.#info] = [view, layer, info];
    view.on("moveend", () => { writePlace(view, this.#id); });
    view.on("directionchange", () => { writePlace(view, this.#id); });
    view.on("lightchange", () => {
      clearTimeout(this.#timer);
      this.#timer = window.setTimeout(() => { writePlace(view, this.#id); }, ADDRESS_MS);
    });
    addEventListener("popstate", () => { this.#return(); });
  }

  /** What was clicked. */
  choose(event: ClickEvent): void {
    const changed = event.id !== this.#id;
    this.#show(event);
    writePlace(this.#view, this.#id, changed);
  }

  /** An object by its id: as if it had been clicked; without a position at the top of its box. */
  async chooseId(id: number, position: Vec3 | null = null, step = true): Promise<void> {
    const changed = id !== this.#id;
    this.#id = id;
    const object = await this.#layer.object(id).catch((reason: unknown) => {
      toast(String(reason));
      return null;
    });
    if (this.#id !== id) return;
    const [low, high] = object?.box ?? [];
    const origin = this.#layer.rendering?.json.origin;
    const top: Vec3 | null = low && high && origin ? [origin[0] + (low[0] + high[0]) / 2, origin[1] + (low[1] + high[1]) / 2, origin[2] + high[2]] : null;
    const event: ClickEvent = { id, position: position ?? top, approximate: false, layer: this.#layer, point: [0, 0], ...(object ?? {}) };
    this.#show(event);
    if (step) writePlace(this.#view, id, changed);
  }

  /** Nothing is chosen any more. */
  forget(): void {
    this.#id = 0;
    this.#layer.clearHighlight();
    writePlace(this.#view, 0);
  }

  #show(event: ClickEvent): void {
    this.#layer.clearHighlight();
    this.#id = event.id;
    if (event.id === 0 && !event.position) {
      this.#info.close();
      return;
    }
    if (event.id > 0 && !QUIET.has(event.class ?? "")) this.#layer.highlight(event.id);
    this.#info.show(event);
  }

  /** To where the address says. */
  #return(): void {
    const { direction, center, zoom, id = 0 } = readPlace(location.hash);
    if (direction !== undefined && this.#view.directions.some((view) => view.id === direction)) this.#view.setDirection(direction);
    if (center) this.#view.setView(center, zoom);
    if (id > 0) void this.chooseId(id, null, false);
    else if (this.#id > 0) this.#info.close();
  }
}

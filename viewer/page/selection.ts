import { Marker, type ClickEvent, type ImageLayer, type Map3D, type Vec3 } from "./map3d.module.js";
import type { InfoPanel } from "./info";
import { NOT_HIGHLIGHTED } from "./card";
import { GESTURES } from "./dom";
import { findWhole } from "./whole";
import { report } from "./toast";
import { readPermalink, type Permalink } from "./permalink";

/** Least distance of the selection from the card, CSS pixels. */
const CLEAR_PX = 40;

/** The selected object: highlighted, described in the info panel and kept in the permalink. The back button returns to the previous selection. */
export class Selection {
  readonly #view: Map3D;
  #layer: ImageLayer;
  readonly #info: InfoPanel;
  readonly #permalink: Permalink;
  #clicks = 0;
  /** Called after the highlights have changed. */
  onChange = (): void => undefined;
  /** The marker of the search result that is selected, or of a spot on the ground. */
  #pin: Marker | undefined;

  constructor(view: Map3D, layer: ImageLayer, info: InfoPanel, permalink: Permalink) {
    [this.#view, this.#layer, this.#info, this.#permalink] = [view, layer, info, permalink];
    addEventListener("popstate", () => this.#restore());
  }

  /** The layer that objects are selected in. */
  get layer(): ImageLayer {
    return this.#layer;
  }

  /** Switches to another layer and clears the selection. */
  setLayer(layer: ImageLayer): void {
    if (this.#permalink.id > 0) this.#info.close();
    this.#layer = layer;
  }

  /** Selects a clicked object, or the building that it is a part of. */
  select(event: ClickEvent): void {
    const number = ++this.#clicks;
    findWhole(this.#layer, event)
      .catch((reason: unknown) => {
        report(reason);
        return event;
      })
      .then((whole) => {
        if (number !== this.#clicks) return;
        const changed = whole.id !== this.#permalink.id;
        this.#show(whole);
        this.#permalink.write(changed);
      }, report);
  }

  /** Selects an object found by a search and flies there: at once, and beside the card as soon as that is shown. */
  async goTo(id: number, position: Vec3, zoom: number): Promise<void> {
    const approach = new AbortController();
    for (const type of GESTURES) addEventListener(type, () => approach.abort(), { once: true, capture: true, signal: approach.signal });
    this.#view.flyTo(position, zoom);
    await this.selectId(id, position, true, true);
    if (!approach.signal.aborted && this.#permalink.id === id) this.#flyClear(position, zoom);
    approach.abort();
  }

  /** Selects an object by its id. @param position default: the top of its bounding box  @param push adds a history entry  @param pin adds a marker with its title, and leaves the map where it is */
  async selectId(id: number, position: Vec3 | null = null, push = true, pin = false): Promise<void> {
    const changed = id !== this.#permalink.id;
    this.#permalink.id = id;
    const object = await this.#layer.object(id).catch((reason: unknown) => {
      report(reason);
      return null;
    });
    if (this.#permalink.id !== id) return;
    const [low, high] = object?.box ?? [];
    const origin = this.#layer.rendering?.json.origin;
    const top: Vec3 | null =
      low && high && origin ? [origin[0] + (low[0] + high[0]) / 2, origin[1] + (low[1] + high[1]) / 2, origin[2] + high[2]] : null;
    const event: ClickEvent = { id, position: position ?? top, approximate: false, layer: this.#layer, point: [0, 0], ...(object ?? {}) };
    const title = this.#show(event, pin);
    if (pin && event.position) this.#pin = new Marker(title, event.position).addTo(this.#view).select();
    if (push) this.#permalink.write(changed);
  }

  /** Clears the selection. */
  clear(): void {
    this.#permalink.id = 0;
    this.#pin?.remove();
    this.#layer.clearHighlight();
    this.onChange();
    this.#permalink.write();
  }

  /** Returns the title of the card. */
  #show(event: ClickEvent, keepsView = false): string {
    this.#pin?.remove();
    this.#layer.clearHighlight();
    this.#permalink.id = event.id;
    if (event.id === 0 && !event.position) {
      this.#info.close();
      return "";
    }
    const isObject = event.id > 0 && !NOT_HIGHLIGHTED.has(event.class ?? "");
    if (isObject) this.#layer.highlight(event.id);
    this.onChange();
    const title = this.#info.show(event, isObject ? this.#showBack(event) : undefined);
    if (!isObject && event.position) this.#pin = new Marker(title, event.position, { showLabel: false }).addTo(this.#view);
    if (event.position && !keepsView) this.#moveClear(event.position);
    return title;
  }

  /** Moves the map until a position is clear of the card: upwards on a phone, whose card is at the bottom, else to the left. */
  #moveClear(position: Vec3): void {
    const at = this.#view.project(position);
    const { left, top, bottom } = this.#info.bounds;
    if (!at || at[0] < left - CLEAR_PX || at[1] > bottom + CLEAR_PX || at[1] < top - CLEAR_PX) return;
    if (left > 0) this.#view.panBy(left - CLEAR_PX - at[0], 0, { smooth: true });
    else this.#view.panBy(0, top - CLEAR_PX - at[1], { smooth: true });
  }

  /** Flies until a position is in the middle of what the card leaves free; in level views, in the middle of the map. */
  #flyClear(position: Vec3, zoom: number): void {
    const at = this.#view.project(position);
    const { left, top } = this.#info.bounds;
    const { clientWidth: width, clientHeight: height } = this.#view.container;
    const [x, y] = left > 0 ? [left / 2, height / 2] : [width / 2, top / 2];
    const scale = 2 ** (this.#view.zoom - Math.min(zoom, this.#view.zoomLimits[1]));
    this.#view.flyTo((at && this.#view.unproject([at[0] + (width / 2 - x) * scale, at[1] + (height / 2 - y) * scale])) ?? position, zoom);
  }

  /** Returns an action that shows the object from behind; undefined when no view has the opposite direction. */
  #showBack({ id, position }: ClickEvent): (() => void) | undefined {
    const { directions, direction, lookAt_deg: ahead_deg } = this.#view;
    const pitch = directions.find((view) => view.id === direction)?.pitch_deg;
    const opposite = directions.find(({ lookAt_deg, pitch_deg }) => pitch_deg === pitch && (lookAt_deg + 180) % 360 === ahead_deg % 360);
    return (
      opposite &&
      (() => {
        const origin = this.#layer.rendering?.json.origin;
        this.#layer.object(id).then(
          (object) => {
            const [low, high] = object?.box ?? [];
            const middle =
              low && high && origin ? (([0, 1, 2] as const).map((k) => origin[k] + (low[k] + high[k]) / 2) as unknown as Vec3) : position;
            this.#view.setDirection(opposite.id, middle);
          },
          (reason: unknown) => report(reason),
        );
      })
    );
  }

  /** Applies the URL after the back or forward button. */
  #restore(): void {
    const { direction, center, zoom, id = 0 } = readPermalink(location.hash);
    this.#permalink.paused(() => {
      if (direction !== undefined && this.#view.directions.some((view) => view.id === direction)) this.#view.setDirection(direction);
      if (center) this.#view.setView(center, zoom);
    });
    if (id > 0) void this.selectId(id, null, false);
    else if (this.#permalink.id > 0) this.#info.close();
  }
}

import type { ClickEvent, imageLayer, map, Vec3 } from "./map3d.mjs";
import type { InfoPanel } from "./info";
import { toast } from "./messages";
import type { Address } from "./address";
import { readPlace } from "./place";

const QUIET = new Set(["terrain", "ground"]);
/** The chosen object: highlighted, described, and kept in the address. The back button goes from choice to choice. */
export class Selection {
  readonly #view: map;
  #layer: imageLayer;
  readonly #info: InfoPanel;
  readonly #address: Address;

  constructor(view: map, layer: imageLayer, info: InfoPanel, address: Address) {
    [this.#view, this.#layer, this.#info, this.#address] = [view, layer, info, address];
    addEventListener("popstate", () => { this.#return(); });
  }

  /** Whose objects are chosen. */
  get layer(): imageLayer {
    return this.#layer;
  }

  /** Objects of another layer are chosen from now on; what is chosen has gone with its own. */
  use(layer: imageLayer): void {
    if (this.#address.id > 0) this.#info.close();
    this.#layer = layer;
  }

  /** What was clicked. */
  choose(event: ClickEvent): void {
    const changed = event.id !== this.#address.id;
    this.#show(event);
    this.#address.write(changed);
  }

  /** An object by its id: as if it had been clicked; without a position at the top of its box. */
  async chooseId(id: number, position: Vec3 | null = null, step = true): Promise<void> {
    const changed = id !== this.#address.id;
    this.#address.id = id;
    const object = await this.#layer.object(id).catch((reason: unknown) => {
      toast(String(reason));
      return null;
    });
    if (this.#address.id !== id) return;
    const [low, high] = object?.box ?? [];
    const origin = this.#layer.rendering?.json.origin;
    const top: Vec3 | null = low && high && origin ? [origin[0] + (low[0] + high[0]) / 2, origin[1] + (low[1] + high[1]) / 2, origin[2] + high[2]] : null;
    const event: ClickEvent = { id, position: position ?? top, approximate: false, layer: this.#layer, point: [0, 0], ...(object ?? {}) };
    this.#show(event);
    if (step) this.#address.write(changed);
  }

  /** Nothing is chosen any more. */
  forget(): void {
    this.#address.id = 0;
    this.#layer.clearHighlight();
    this.#address.write();
  }

  #show(event: ClickEvent): void {
    this.#layer.clearHighlight();
    this.#address.id = event.id;
    if (event.id === 0 && !event.position) {
      this.#info.close();
      return;
    }
    if (event.id > 0 && !QUIET.has(event.class ?? "")) this.#layer.highlight(event.id);
    this.#info.show(event, event.id > 0 && !QUIET.has(event.class ?? "") ? this.#behind(event) : undefined);
  }

  /** What shows the other side of an object; undefined where no view does. */
  #behind({ id, position }: ClickEvent): (() => void) | undefined {
    const { directions, direction, lookAt_deg } = this.#view;
    const pitch = directions.find((view) => view.id === direction)?.pitchDeg;
    const opposite = directions.find(({ lookAtDeg, pitchDeg }) => pitchDeg === pitch && (lookAtDeg + 180) % 360 === lookAt_deg % 360);
    return opposite && (() => {
      const origin = this.#layer.rendering?.json.origin;
      this.#layer.object(id).then((object) => {
        const [low, high] = object?.box ?? [];
        const middle = low && high && origin ? ([0, 1, 2] as const).map((k) => origin[k] + (low[k] + high[k]) / 2) as unknown as Vec3 : position;
        this.#view.setDirection(opposite.id);
        if (middle) this.#view.setView(middle);
      }, (reason: unknown) => { toast(String(reason)); });
    });
  }

  /** To where the address says. */
  #return(): void {
    const { direction, center, zoom, id = 0 } = readPlace(location.hash);
    this.#address.quietly(() => {
      if (direction !== undefined && this.#view.directions.some((view) => view.id === direction)) this.#view.setDirection(direction);
      if (center) this.#view.setView(center, zoom);
    });
    if (id > 0) void this.chooseId(id, null, false);
    else if (this.#address.id > 0) this.#info.close();
  }
}

import type { AttributeInfo, imageLayer, map } from "./map3d.mjs";
import type { theme } from "./map3d-theme.mjs";
import type { Address } from "./address";
import { byId } from "./dom";
import { toast } from "./messages";
import { say } from "./i18n";

/** Text of more values tells nothing as colours. */
const MOST_VALUES = 60;

/** A choice of attributes by which the objects are coloured. */
export class Colors {
  readonly #view: map;
  #layer: imageLayer;
  readonly #address: Address;
  readonly #select = byId("by") as HTMLSelectElement;
  #theme: theme | undefined;

  constructor(view: map, layer: imageLayer, address: Address) {
    [this.#view, this.#layer, this.#address] = [view, layer, address];
  }

  /** What colours the objects. */
  get theme(): theme | undefined {
    return this.#theme;
  }

  /** Offers what the objects have; takes the attribute that the address names. */
  async open(): Promise<void> {
    const all = (await this.#layer.attributes()).filter(tells);
    if (all.length === 0) return;
    this.#select.append(...all.map((info) => new Option(nameOf(info))));
    byId("colors").hidden = false;
    this.#select.addEventListener("change", () => void this.#choose(all[this.#select.selectedIndex - 1]));
    const asked = all.findIndex((info) => keyOf(info) === this.#address.by);
    if (asked < 0) return;
    this.#select.selectedIndex = asked + 1;
    await this.#choose(all[asked]);
  }

  /** Colours another layer, by its own attribute of the same name. */
  async use(layer: imageLayer): Promise<void> {
    this.#layer = layer;
    this.#theme?.remove();
    this.#theme = undefined;
    const { by } = this.#address;
    if (by !== "") await this.#paint((await layer.attributes()).find((info) => keyOf(info) === by));
  }

  async #choose(info: AttributeInfo | undefined): Promise<void> {
    this.#address.by = info ? keyOf(info) : "";
    this.#address.write();
    await this.use(this.#layer);
  }

  /** Nothing, where there is no such attribute. */
  async #paint(info: AttributeInfo | undefined): Promise<void> {
    const layer = this.#layer;
    if (!info) return;
    try {
      const made = await import("./map3d-theme.mjs");
      if (this.#address.by !== keyOf(info) || this.#layer !== layer) return;
      this.#theme?.remove();
      this.#theme = new made.theme(layer, info, { legend: byId("legend"), title: info.name }).addTo(this.#view);
    } catch (reason) {
      toast(`${say("noColors")}: ${String(reason)}`);
    }
  }
}

/** Something is to be seen: not all the same, nor all different. */
const tells = ({ type, variety }: AttributeInfo): boolean => variety > 1 && (type === "number" || variety <= MOST_VALUES);

/** In the address; an attribute may be called as what every object has. */
const keyOf = ({ of, name }: AttributeInfo): string => (of === "object" ? `:${name}` : name);

const nameOf = ({ of, name }: AttributeInfo): string => (of === "object" && (name === "class" || name === "asset") ? say(name) : name);

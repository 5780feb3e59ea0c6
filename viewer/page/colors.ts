import type { AttributeInfo, ImageLayer, Map3D } from "./map3d.module.js";
import type { Theme } from "./map3d-theme.module.js";
import type { Permalink } from "./permalink";
import { byId } from "./dom";
import { toast } from "./toast";
import { introduce, message } from "./i18n";

/** Text attributes with more distinct values are not offered. */
const MAX_VALUES = 60;

/** Colours objects by an attribute that the user selects. */
export class Colors {
  readonly #view: Map3D;
  #layer: ImageLayer;
  readonly #permalink: Permalink;
  readonly #select = byId("color-by") as HTMLSelectElement;
  #theme: Theme | undefined;

  constructor(view: Map3D, layer: ImageLayer, permalink: Permalink) {
    [this.#view, this.#layer, this.#permalink] = [view, layer, permalink];
  }

  /** The active theme. */
  get theme(): Theme | undefined {
    return this.#theme;
  }

  /** Lists the attributes, and applies the one in the permalink. */
  async open(): Promise<void> {
    const all = (await this.#layer.attributes()).filter(isUseful);
    if (all.length === 0) return;
    this.#select.append(...all.map((info) => new Option(nameOf(info))));
    byId("colors").hidden = false;
    this.#select.addEventListener("change", () => void this.#setAttribute(all[this.#select.selectedIndex - 1]));
    const index = all.findIndex((info) => keyOf(info) === this.#permalink.by);
    if (index < 0) return;
    this.#select.selectedIndex = index + 1;
    await this.#setAttribute(all[index]);
  }

  /** Switches to another layer, coloured by its attribute of the same name. */
  async setLayer(layer: ImageLayer): Promise<void> {
    this.#layer = layer;
    this.#theme?.remove();
    this.#theme = undefined;
    const { by } = this.#permalink;
    if (by !== "") await this.#applyTheme((await layer.attributes()).find((info) => keyOf(info) === by));
  }

  async #setAttribute(info: AttributeInfo | undefined): Promise<void> {
    this.#permalink.by = info ? keyOf(info) : "";
    this.#permalink.write();
    await this.setLayer(this.#layer);
  }

  /** Does nothing when the layer has no such attribute. */
  async #applyTheme(info: AttributeInfo | undefined): Promise<void> {
    const layer = this.#layer;
    if (!info) return;
    try {
      const entry = await import("./map3d-theme.module.js");
      if (this.#permalink.by !== keyOf(info) || this.#layer !== layer) return;
      this.#theme?.remove();
      this.#theme = new entry.theme(layer, info, { legend: byId("legend"), title: info.name }).addTo(this.#view);
    } catch (reason) {
      toast(introduce("colorsFailed", reason));
    }
  }
}

/** Values differ, and text values repeat. */
const isUseful = ({ type, variety }: AttributeInfo): boolean => variety > 1 && (type === "number" || variety <= MAX_VALUES);

/** Key in the permalink. A colon marks an object's own fields, since an attribute may have the same name. */
const keyOf = ({ of, name }: AttributeInfo): string => (of === "object" ? `:${name}` : name);

const nameOf = ({ of, name }: AttributeInfo): string => (of === "object" && (name === "class" || name === "asset") ? message(name) : name);

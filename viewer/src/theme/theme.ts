import { adoptStyles } from "../core/dom";
import { MapLayer, UsageError, type AttributeInfo, type imageLayer, type map } from "../map3d";
import { classify, type Classes, type ThemeClass } from "./classes";
import { Legend } from "./legend";
import { STYLES } from "./styles";
import { getThemeMessages } from "./i18n";

export interface ThemeOptions {
  /** Of the legend. Default the attribute's name. */
  title?: string;
  /** How many classes numbers get. Default 5. */
  classes?: number;
  /** #rrggbb, of numbers from the least to the greatest, else for each value. */
  colors?: readonly string[];
  /** Objects of other classes than those pressed in the legend, and without a value: pale, or not at all. Default "dimmed". */
  others?: "dimmed" | "hidden";
  /** Where the legend goes; null: none. Default the map's lower left corner. */
  legend?: HTMLElement | null;
  /** BCP 47. Default the map's. */
  language?: string;
}

export interface ThemeEvents {
  /** Objects have their colours. */
  ready: { classes: readonly ThemeClass[] };
  /** The map's "error" says so, too. */
  error: { error: Error };
}

/** Colours a layer's objects by an attribute, with a legend whose classes can be pressed to show only those. Takes the place of the layer's style. */
export class theme extends MapLayer<map, ThemeEvents> {
  readonly options: ThemeOptions;
  readonly #layer: imageLayer;
  readonly #name: string;
  readonly #info: AttributeInfo | undefined;
  #legend: Legend | undefined;
  #classes: readonly ThemeClass[] = [];
  #chosen: readonly ThemeClass[] = [];

  /** The attribute: its name, or one of the layer's `attributes()`. The layer must be on the map, and ready, once the theme is added. */
  constructor(layer: imageLayer, attribute: string | AttributeInfo, options: ThemeOptions = {}) {
    super();
    this.#layer = layer;
    this.#name = typeof attribute === "string" ? attribute : attribute.name;
    this.#info = typeof attribute === "string" ? undefined : attribute;
    this.options = options;
  }

  /** In the legend's order; none before "ready". */
  get classes(): readonly ThemeClass[] {
    return this.#classes;
  }

  /** Classes that are pressed in the legend; without any, all. */
  get chosen(): readonly ThemeClass[] {
    return this.#chosen;
  }

  /** Of the legend. */
  get title(): string {
    return this.options.title ?? this.#name;
  }

  protected onAdd(map: map): void {
    adoptStyles(document, STYLES);
    this.#load(map).catch((reason: unknown) => {
      if (this.map !== map) return;
      const error = reason instanceof Error ? reason : new Error(String(reason));
      this.fire("error", { error });
      map.fire("error", { error });
    });
  }

  protected onRemove(): void {
    this.#legend?.box.remove();
    this.#legend = undefined;
    if (this.#classes.length > 0) this.#layer.setStyle({});
    this.#classes = this.#chosen = [];
  }

  async #load(map: map): Promise<void> {
    if (!this.#layer.rendering) await new Promise((ready) => this.#layer.once("ready", ready));
    const info = this.#info ?? (await this.#find());
    const column = await this.#layer.column(info);
    if (this.map !== map) return;
    const { language = map.language, classes = 5, colors } = this.options;
    const words = getThemeMessages(language);
    const found = classify(info, column, { classes, colors, language, rest: words.rest });
    this.#show(map, info.type === "boolean" ? { ...found, classes: found.classes.map((row) => ({ ...row, label: row.label === "true" ? words.yes : words.no })) } : found);
  }

  async #find(): Promise<AttributeInfo> {
    const all = await this.#layer.attributes();
    const info = all.find(({ of, name }) => of === "attributes" && name === this.#name) ?? all.find(({ name }) => name === this.#name);
    if (!info) throw new UsageError(`no attribute "${this.#name}"; the rendering has ${all.map(({ name }) => name).join(", ") || "none"}`);
    return info;
  }

  #show(map: map, found: Classes): void {
    this.#classes = found.classes;
    this.#paint(new Set());
    const { legend } = this.options;
    if (legend !== null) {
      this.#legend = new Legend(this.title, found, (chosen) => { this.#paint(chosen); });
      (legend ?? map.overlayPane).append(this.#legend.box);
    }
    this.fire("ready", { classes: this.#classes });
  }

  /** Classes by their places; none: all. */
  #paint(chosen: ReadonlySet<number>): void {
    this.#chosen = this.#classes.filter((_, k) => chosen.size === 0 || chosen.has(k));
    const colors = new Map(this.#chosen.flatMap(({ ids, color }) => ids.map((id) => [id, color] as const)));
    this.#layer.setStyle({ colors, only: colors.keys(), others: this.options.others ?? "dimmed" });
  }
}

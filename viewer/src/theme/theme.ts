import { adoptStyles } from "../core/dom";
import { MapLayer, UsageError, type AttributeInfo, type AttributeValue, type ColumnSummary, type ImageLayer, type Map3D } from "../map3d";
import { classify, type Classification, type ThemeClass } from "./classes";
import { Legend } from "./legend";
import { STYLES } from "./styles";
import { getThemeMessages } from "./i18n";

export interface ThemeOptions {
  /** Title of the legend. Default: the attribute's name. */
  title?: string;
  /** Number of classes for numbers. Default 5. */
  classes?: number;
  /** Colours as #rrggbb: a ramp from the lowest to the highest number, else one per value. Default: a palette. */
  colors?: readonly string[];
  /** How objects without a value, or of classes not pressed in the legend, are shown. Default "dimmed". */
  others?: "dimmed" | "hidden";
  /** Element for the legend; null for none. Default: the map, in its lower left corner. */
  legend?: HTMLElement | null;
  /** BCP 47 tag. Default: the map's. */
  language?: string;
}

export interface ThemeEvents {
  /** The objects are coloured. */
  ready: { classes: readonly ThemeClass[] };
  /** The attribute cannot be read. The map fires "error", too. */
  error: { error: Error };
}

/** Colours a layer's objects by an attribute. Pressing classes in the legend shows only those. Replaces the layer's style. */
export class Theme extends MapLayer<Map3D, ThemeEvents> {
  readonly options: ThemeOptions;
  readonly #layer: ImageLayer;
  readonly #name: string;
  readonly #info: AttributeInfo | undefined;
  #legend: Legend | undefined;
  #classes: readonly ThemeClass[] = [];
  #chosen: readonly ThemeClass[] = [];
  /** Indices of the pressed classes. */
  #pressed: ReadonlySet<number> = new Set();
  /** Adds the objects in view, in a large rendering. */
  #onMoveEnd: (() => void) | undefined;

  /** @param attribute its name, or one of the layer's `attributes()` */
  constructor(layer: ImageLayer, attribute: string | AttributeInfo, options: ThemeOptions = {}) {
    super();
    this.#layer = layer;
    this.#name = typeof attribute === "string" ? attribute : attribute.name;
    this.#info = typeof attribute === "string" ? undefined : attribute;
    this.options = options;
  }

  /** The classes, in the order of the legend; empty before "ready". */
  get classes(): readonly ThemeClass[] {
    return this.#classes;
  }

  /** The classes pressed in the legend; all if none is pressed. */
  get chosen(): readonly ThemeClass[] {
    return this.#chosen;
  }

  /** Title of the legend. */
  get title(): string {
    return this.options.title ?? this.#name;
  }

  protected onAdd(map: Map3D): void {
    adoptStyles(document, STYLES);
    this.#run(map, this.#load(map));
  }

  protected onRemove(map: Map3D): void {
    if (this.#onMoveEnd) map.off("moveend", this.#onMoveEnd);
    this.#legend?.box.remove();
    this.#legend = this.#onMoveEnd = undefined;
    if (this.#classes.length > 0) this.#layer.setStyle({});
    this.#classes = this.#chosen = [];
    this.#pressed = new Set();
  }

  /** Reports the failure of a task. */
  #run(map: Map3D, task: Promise<void>): void {
    task.catch((reason: unknown) => {
      if (this.map !== map) return;
      const error = reason instanceof Error ? reason : new Error(String(reason));
      this.fire("error", { error });
      map.fire("error", { error });
    });
  }

  async #load(map: Map3D): Promise<void> {
    if (!this.#layer.rendering) await new Promise((ready) => this.#layer.once("ready", ready));
    const info = this.#info ?? (await this.#findAttribute());
    const summary = await this.#layer.columnSummary(info);
    const column = summary ? new Map<number, AttributeValue>() : await this.#layer.column(info);
    if (this.map !== map) return;
    const { language = map.language, classes = 5, colors } = this.options;
    const messages = getThemeMessages(language);
    const classification = classify(info, column, { classes, colors, language, otherLabel: messages.other }, summary ?? undefined);
    if (summary) await this.#follow(map, info, summary, classification);
    if (this.map === map)
      this.#show(
        map,
        info.type === "boolean"
          ? {
              ...classification,
              classes: classification.classes.map((row) => ({ ...row, label: row.label === "true" ? messages.yes : messages.no })),
            }
          : classification,
      );
  }

  /** Adds the objects in view to the classes, now and after each movement: reads the shards with their values. */
  async #follow(map: Map3D, info: AttributeInfo, { shard_size, shards }: ColumnSummary, { add }: Classification): Promise<void> {
    const read = new Set<number>();
    const follow = async (): Promise<void> => {
      const seen = new Set(
        (await map.objectsInView(true)).flatMap(({ id, layer }) => (layer === this.#layer ? Math.floor(id / shard_size) : [])),
      );
      const missing = shards.filter((shard) => seen.has(shard) && !read.has(shard));
      if (missing.length === 0) return;
      for (const shard of missing) read.add(shard);
      try {
        add(
          await this.#layer.column(
            info,
            missing.map((shard) => shard * shard_size),
          ),
        );
      } catch (reason) {
        for (const shard of missing) read.delete(shard);
        throw reason;
      }
      if (this.map === map) this.#applyStyle(this.#pressed);
    };
    await follow();
    if (this.map === map) map.on("moveend", (this.#onMoveEnd = () => this.#run(map, follow())));
  }

  async #findAttribute(): Promise<AttributeInfo> {
    const all = await this.#layer.attributes();
    const info = all.find(({ of, name }) => of === "attributes" && name === this.#name) ?? all.find(({ name }) => name === this.#name);
    if (!info) throw new UsageError(`no attribute "${this.#name}"; the rendering has ${all.map(({ name }) => name).join(", ") || "none"}`);
    return info;
  }

  #show(map: Map3D, classification: Classification): void {
    this.#classes = classification.classes;
    this.#applyStyle(this.#pressed);
    const { legend } = this.options;
    if (legend !== null) {
      this.#legend = new Legend(this.title, classification, (chosen) => this.#applyStyle(chosen));
      (legend ?? map.overlayPane).append(this.#legend.box);
    }
    this.fire("ready", { classes: this.#classes });
  }

  /** Applies the style. @param chosen indices of the classes to show; all if empty */
  #applyStyle(chosen: ReadonlySet<number>): void {
    this.#pressed = chosen;
    this.#chosen = this.#classes.filter((_, k) => chosen.size === 0 || chosen.has(k));
    const colors = new Map(this.#chosen.flatMap(({ ids, color }) => ids.map((id) => [id, color] as const)));
    this.#layer.setStyle({ colors, only: colors.keys(), others: this.options.others ?? "dimmed", descendants: false }); // its values are inherited already
  }
}

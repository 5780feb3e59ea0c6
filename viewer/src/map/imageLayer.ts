import { MapLayer } from "../core/mapLayer";
import { asError, UsageError } from "../core/errors";
import type { Vec2 } from "../core/vec";
import { parseColor, type Rgb } from "../draw/color";
import type { Clip } from "../draw/depthMapping";
import { listBakedLightKinds, MODES, listRequiredKinds, type BakedLight, type Mode, type Pass, type TileAccess } from "../draw/drawer";
import type { DrawStyles } from "../draw/drawStyle";
import type { Frame, Tile } from "../geo/frame";
import { towardsLight, type Light } from "../geo/light";
import type { LayerInfo, LayerKind, Rendering, View } from "../geo/manifest";
import { findShadow } from "../geo/shadows";
import { Objects, type AttributeInfo, type AttributeValue, type ObjectInfo, type SearchEntry } from "../tiles/objects";
import { HttpSource, type Source } from "../tiles/source";
import { LayerTiles } from "../tiles/layerTiles";
import { findMatchingView } from "./compatibility";
import { computeDepthRange, makeDepthMapping, planLayer, type LayerPlan } from "./layerPlan";
import { makeDrawStyles, isHidden, type ObjectStyle } from "./objectStyle";
import type { ImageLayerHost, LayerContext, ViewState } from "./layerContext";

/** How a layer begins; all can be left out. */
export interface ImageLayerOptions {
  /** lit | color | picture | normal | id | depth. Default "lit". */
  mode?: Mode;
  /** 0..1. Default 1. */
  opacity?: number;
  /** Colour of highlights that name none. Default "#e4572e". */
  highlightColor?: string;
  /** Overrides the manifest's. */
  attribution?: string;
  /** Where several layers show something, what is nearest is seen. false: it is painted over layers that were added before. Default true. */
  combine?: boolean;
}

/** What a layer fires. */
export interface ImageLayerEvents {
  /** The manifest has been read. */
  ready: { rendering: Rendering };
  /** The map's "error" says so, too. */
  error: { error: Error };
}

/** A rendering on the map, from base URLs or another source. Several base URLs are several hosts with the same tiles; requests are spread over them by tile. */
export class imageLayer extends MapLayer<ImageLayerHost, ImageLayerEvents> {
  readonly options: Required<Omit<ImageLayerOptions, "attribution">> & Pick<ImageLayerOptions, "attribution">;
  /** Where it comes from. */
  readonly source: Source;
  #mode: Mode;
  #context: LayerContext | undefined;
  #name = "";
  #tiles: LayerTiles | undefined;
  #rendering: Rendering | undefined;
  #objects: Objects | undefined;
  #colors: ReadonlyMap<number, Rgb> = new Map();
  #drawStyles: DrawStyles | null = null;
  /** Those of #colors that are not hidden. */
  #shownColors: ReadonlyMap<number, Rgb> = new Map();
  #clip: Clip | null = null;
  /** There will be no manifest. */
  #failed = false;

  /** @param urls base URLs, or another source  @throws UsageError without one, or for a mode that is unknown */
  constructor(urls: string | readonly string[] | Source, options: ImageLayerOptions = {}) {
    super();
    this.options = { mode: "lit", opacity: 1, highlightColor: "#e4572e", combine: true, ...options };
    this.#mode = checkMode(this.options.mode);
    this.source = typeof urls === "object" && "tile" in urls ? urls : new HttpSource(urls);
  }

  /** @internal The same rendering with the same looks, for another map. */
  copy(): imageLayer {
    const made = new imageLayer(this.source, { ...this.options, mode: this.#mode });
    made.#drawStyles = this.#drawStyles;
    return made.#setColors(this.#colors);
  }

  /** The manifest; undefined until it has been read. */
  get rendering(): Rendering | undefined {
    return this.#rendering;
  }

  /** Whose data it is: the option's, else the manifest's; "" before "ready". */
  get attribution(): string {
    return this.options.attribution ?? this.#rendering?.json.attribution ?? "";
  }

  /** How it is shown. */
  get mode(): Mode {
    return this.#mode;
  }

  /** Shows it otherwise. @throws UsageError for a mode that is unknown; one whose layers the rendering lacks is the map's "error" */
  setMode(mode: Mode): this {
    this.#mode = checkMode(mode);
    this.#checkLayers();
    return this.#redraw();
  }

  /** 0..1 */
  setOpacity(opacity: number): this {
    this.options.opacity = Math.min(Math.max(opacity, 0), 1);
    return this.#redraw();
  }

  /** 0 to 1. */
  get opacity(): number {
    return this.options.opacity;
  }

  /** Shows the layer in a part of the map only: left, top, right, bottom in shares of its width and height; null: in all of it. */
  setClip(clip: Clip | null): this {
    this.#clip = clip;
    return this.#redraw();
  }

  /** The part of the map that it is shown in; null: all of it. */
  get clip(): Clip | null {
    return this.#clip;
  }

  /** Shows objects in a colour (#rrggbb), besides those that are highlighted already. */
  highlight(ids: number | Iterable<number>, { color = this.options.highlightColor }: { color?: string } = {}): this {
    const rgb = parseColor(color);
    const colors = new Map(this.#colors);
    for (const id of typeof ids === "number" ? [ids] : ids) colors.set(id >>> 0, rgb);
    return this.#setColors(colors);
  }

  /** Without ids: all highlights. */
  clearHighlight(ids?: number | Iterable<number>): this {
    const gone = new Set(typeof ids === "number" ? [ids] : (ids ?? this.#colors.keys()));
    return this.#setColors(new Map([...this.#colors].filter(([id]) => !gone.has(id))));
  }

  /** Highlighted object ids. */
  get highlighted(): number[] {
    return [...this.#colors.keys()];
  }

  /** Colours, dims and hides objects, in place of the style before; {} shows all as they are. @throws UsageError for what is no colour */
  setStyle(style: ObjectStyle): this {
    this.#drawStyles = makeDrawStyles(style);
    return this.#setColors(this.#colors);
  }

  /** @internal */
  isHidden(id: number): boolean {
    return isHidden(this.#drawStyles, id);
  }

  /** @internal What `hides` goes by; null: all is shown. Another object whenever it has changed. */
  get drawStyles(): DrawStyles | null {
    return this.#drawStyles;
  }

  /** Name, class and attributes of an object; null when nothing is known of it. */
  async object(id: number): Promise<ObjectInfo | null> {
    return (await this.#objects?.find(id)) ?? null;
  }

  /** Attributes that the objects have, for `column`; none when the rendering does not list them. */
  async attributes(): Promise<readonly AttributeInfo[]> {
    return (await this.#objects?.attributes()) ?? [];
  }

  /** What an attribute says of all objects, by id. */
  async column({ column }: Pick<AttributeInfo, "column">): Promise<ReadonlyMap<number, AttributeValue>> {
    return (await this.#objects?.column(column)) ?? new Map<number, AttributeValue>();
  }

  /** The search index: id, label, local position. */
  async searchIndex(): Promise<readonly SearchEntry[]> {
    return (await this.#objects?.search()) ?? [];
  }

  protected onAdd(map: ImageLayerHost): void {
    const stage = map.layerContext;
    if (!stage) return; // the map has said why
    this.#context = stage;
    this.#name = stage.createName();
    const failed = (error: Error): void => {
      if (this.#context !== stage) return;
      this.#failed = !this.#rendering;
      this.fire("error", { error });
      stage.report(error);
    };
    this.#tiles = new LayerTiles(this.#name, this.source, stage.tileResources, (error) => {
      if (error) failed(error);
      stage.requestFrame();
    });
    this.source.manifest().then((rendering) => {
      if (this.#context === stage) this.#start(rendering, stage);
    }).catch((reason: unknown) => { failed(asError(reason)); });
  }

  protected onRemove(): void {
    this.#context?.dropTiles(this.#name);
    this.#context = this.#tiles = this.#rendering = this.#objects = undefined;
  }

  /** @internal The layer's view that looks as a frame does. */
  findView(frame: Frame): View | undefined {
    return this.#rendering && findMatchingView(this.#rendering, frame);
  }

  /** @internal Its manifest is on the way. */
  get isLoading(): boolean {
    return !this.#rendering && !this.#failed;
  }

  /** @internal Rendered light that it shows in a light; null before its manifest is here. */
  getBakedLight(light: Readonly<Light>): BakedLight | null {
    return this.#rendering ? this.#findBakedLight(this.#rendering, light) : null;
  }

  /** @internal Something of it can hide what other layers show. */
  get isCombinable(): boolean {
    return this.options.combine && this.options.opacity > 0 && this.#rendering?.layers.has("depth") === true;
  }

  /** @internal It shows something at a point (shares of the map's width and height). */
  showsAt([x, y]: Vec2): boolean {
    const [left, top, right, bottom] = this.#clip ?? [0, 0, 1, 1];
    return this.options.opacity > 0 && x >= left && x < right && y >= top && y < bottom;
  }

  /** @internal */
  get tiles(): LayerTiles | undefined {
    return this.#tiles;
  }

  /** @internal What to paint and to fetch; `kinds` are read by others. */
  plan(sight: ViewState, light: Readonly<Light>, kinds: readonly LayerKind[], combined: boolean): LayerPlan | null {
    const view = this.findView(sight.camera.frame);
    if (!view || !this.#rendering || !this.#tiles || this.options.opacity === 0) return null;
    const mode = this.#effectiveMode(this.#rendering);
    const needed = listRequiredKinds(mode, this.#needsMask(this.#rendering), combined);
    const baked = this.#findBakedLight(this.#rendering, light);
    const ids: LayerKind[] = this.#shownColors.size > 0 || this.#drawStyles ? ["id"] : [];
    const read = [...new Set([...ids, ...kinds])].filter((kind) => !needed.includes(kind));
    const extra = [...(light.lit ? listBakedLightKinds(mode, baked) : []), ...read];
    return planLayer(sight, this.#rendering, view, this.#tiles, { baked, layers: withShadowLayer(this.#rendering, baked), needed, extra });
  }

  /** @internal @param before layers with which it is combined and that were added before; null: it is not combined */
  makePass(plan: LayerPlan, { origin }: ViewState, before: number | null): Pass {
    const rendering = this.#rendering as Rendering;
    return {
      mode: this.#effectiveMode(rendering),
      level: plan.level,
      quads: plan.quads,
      tiles: this.#makeTileAccess(plan.view, plan.layers),
      bakedLight: plan.baked,
      highlight: this.#shownColors,
      drawStyles: this.#drawStyles,
      masked: this.#needsMask(rendering),
      opacity: this.options.opacity,
      depths: before === null ? null : makeDepthMapping(rendering, plan, origin, before),
      relief: rendering.layers.has("depth") ? makeDepthMapping(rendering, plan, origin, before ?? 0) : null,
      clip: this.#clip,
      depthRange: computeDepthRange(rendering, plan.view),
    };
  }

  #setColors(colors: ReadonlyMap<number, Rgb>): this {
    this.#colors = colors;
    this.#shownColors = new Map([...colors].filter(([id]) => !this.isHidden(id)));
    return this.#redraw();
  }

  #start(rendering: Rendering, stage: LayerContext): void {
    stage.checkCompatible(rendering);
    this.#rendering = rendering;
    this.#objects = new Objects(this.source, rendering.json);
    stage.onManifest(rendering);
    this.#checkLayers();
    this.fire("ready", { rendering });
  }

  #checkLayers(): void {
    const [rendering, stage] = [this.#rendering, this.#context];
    if (!rendering || !stage) return;
    const missing = listRequiredKinds(this.#effectiveMode(rendering), this.#needsMask(rendering), false).filter((kind) => !rendering.layers.has(kind));
    if (missing.length > 0) stage.report(new UsageError(`mode "${this.#mode}" needs the layer ${missing.join(", ")}, which rendering "${rendering.json.name}" does not have`));
  }

  /** Without normals nothing can be lit. */
  #effectiveMode(rendering: Rendering): Mode {
    return this.#mode === "lit" && !rendering.layers.has("normal") ? "color" : this.#mode;
  }

  #needsMask(rendering: Rendering): boolean {
    return rendering.layers.get(this.#mode === "picture" ? "picture" : "color")?.format === "jpeg";
  }

  /** Rendered light that suits a light. */
  #findBakedLight({ layers, json }: Rendering, light: Readonly<Light>): BakedLight {
    const shadow = light.shadows && light.altitude_deg > 0 ? findShadow(json.layers, towardsLight(light)) : null;
    return { shadow, occlusion: light.occlusion && layers.has("ao") };
  }

  #makeTileAccess(view: View, layers: ReadonlyMap<string, LayerInfo>): TileAccess {
    const store = this.#tiles as LayerTiles;
    const stored = (kind: LayerKind, tile: Tile): ReturnType<LayerTiles["get"]> => {
      const layer = layers.get(kind);
      return layer && store.get(view, layer, tile);
    };
    return {
      key: (kind, tile) => {
        const layer = layers.get(kind);
        return layer ? store.key(view, layer, tile) : "";
      },
      data: (kind, tile) => stored(kind, tile)?.data,
      onUploaded: (kind, tile) => {
        if (kind !== "id" && kind !== "depth") store.releaseData(view, layers.get(kind), tile);
      },
    };
  }

  #redraw(): this {
    this.#context?.requestFrame();
    return this;
  }
}

/** A rendering's layers by kind, with the one that has the shadows. */
function withShadowLayer({ layers }: Rendering, { shadow }: BakedLight): ReadonlyMap<string, LayerInfo> {
  return shadow && layers.get(shadow.layer.kind) !== shadow.layer ? new Map([...layers, [shadow.layer.kind, shadow.layer]]) : layers;
}

function checkMode(mode: Mode): Mode {
  if (!MODES.includes(mode)) throw new UsageError(`mode "${mode}" is unknown; take one of ${MODES.join(", ")}`);
  return mode;
}

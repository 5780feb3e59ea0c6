import { checkNumber } from "../core/check";
import { getPlugin } from "../core/plugins";
import { MapLayer } from "../core/mapLayer";
import { fillOptions, option, optionOr, type FilledOptionsOf, type OptionsOf } from "../core/options";
import { asError, isGone, UsageError } from "../core/errors";
import type { Vec2 } from "../core/vec";
import { parseColor, type Rgb } from "../draw/color";
import type { Clip } from "../draw/depthMapping";
import { listBakedLightKinds, MODES, listRequiredKinds, type BakedLight, type Mode, type LayerPass, type TileAccess } from "../draw/drawer";
import type { DrawStyles } from "../draw/drawStyle";
import type { Frame, Tile } from "../geo/frame";
import { towardsLight, type Light } from "../geo/light";
import type { LayerInfo, Rendering, View } from "../geo/manifest";
import type { LayerKind } from "../tiles/tileData";
import { findShadow } from "../geo/shadows";
import { Objects, type AttributeInfo, type AttributeValue, type ColumnSummary, type ObjectInfo, type SearchEntry } from "../tiles/objects";
import { HttpSource, type Source } from "../tiles/source";
import { LayerTiles } from "../tiles/layerTiles";
import { findMatchingView } from "./compatibility";
import { noObject } from "./findPosition";
import { computeDepthRange, makeDepthMapping, planLayer, type LayerPlan } from "./layerPlan";
import { inherit, makeDrawStyles, isHidden, listStyledIds, type ObjectStyle } from "./objectStyle";
import type { ImageLayerHost, LayerContext, ViewState } from "./layerContext";
import type { ClickEvent, HoverEvent, TooltipContent } from "./options";

/** Most objects that are looked at for a name. */
const MOST_NAMESAKES = 32;
const HOVER_EVENTS = ["mouseover", "mouseout", "mousemove"] as const;

type BindTooltip = (layer: ImageLayer, content: TooltipContent, getPane: () => HTMLElement | undefined) => () => void;

const LAYER_OPTIONS = {
  /** One of lit | color | picture | normal | id | depth. Default "lit". */
  mode: optionOr<Mode>("lit"),
  /** Opacity, 0 to 1. Default 1. */
  opacity: optionOr<number>(1, checkNumber),
  /** Default colour of highlights. Default "#19b5e0". */
  highlightColor: optionOr<string>("#19b5e0"),
  /** Attribution text. Default: the manifest's. */
  attribution: option<string>(),
  /** Combines the layer with others by depth, so that the nearest surface is visible. false: draws it over earlier layers. Default true. */
  combine: optionOr<boolean>(true),
};

/** Options of an image layer. */
export interface ImageLayerOptions extends OptionsOf<typeof LAYER_OPTIONS> {}

/** Events of an image layer. */
export interface ImageLayerEvents {
  /** The manifest has loaded. */
  ready: { rendering: Rendering };
  /** An error, which the map's "error" reports as well. */
  error: { error: Error };
  /** One of its objects was clicked or tapped; fires after the map's "click", with the same fields. */
  click: ClickEvent;
  /** The pointer has come over one of its objects. Listening to this, or to the other events of the pointer, fetches the ids of everything in view. */
  mouseover: HoverEvent;
  /** The pointer has left the object of the last "mouseover", whose fields it has. */
  mouseout: HoverEvent;
  /** The pointer moves over one of its objects. */
  mousemove: HoverEvent;
}

/** A rendering on the map, from base URLs or another source. Several base URLs are hosts with the same tiles; requests are spread over them by tile. */
export class ImageLayer extends MapLayer<ImageLayerHost, ImageLayerEvents> {
  readonly options: FilledOptionsOf<typeof LAYER_OPTIONS>;
  /** Its source. */
  readonly source: Source;
  #mode: Mode;
  #context: LayerContext | undefined;
  #name = "";
  #tiles: LayerTiles | undefined;
  #rendering: Rendering | undefined;
  #objects: Objects | undefined;
  #colors: ReadonlyMap<number, Rgb> = new Map();
  #style: ObjectStyle = {};
  #drawStyles: DrawStyles | null = null;
  /** Descendants of the objects in #colors and #style; none while they are loading. */
  #descendants = new Map<number, readonly number[]>();
  /** The colours of #colors and their descendants, without hidden objects. */
  #shownColors: ReadonlyMap<number, Rgb> = new Map();
  #clip: Clip | null = null;
  #unbindTooltip: (() => void) | undefined;
  /** @internal Why the manifest could not be loaded. */
  loadError: Error | undefined;

  /** @param urls base URLs, or another source  @throws UsageError without a URL, or for an unknown option or mode */
  constructor(urls: string | readonly string[] | Source, options: ImageLayerOptions = {}) {
    super();
    this.options = fillOptions(LAYER_OPTIONS, options);
    this.#mode = checkMode(this.options.mode);
    this.source = typeof urls === "object" && "tile" in ((urls as object | null) ?? {}) ? (urls as Source) : new HttpSource(urls as string);
  }

  /** @internal Makes a layer of the same rendering with the same styles, for another map. */
  copy(): ImageLayer {
    const copy = new ImageLayer(this.source, { ...this.options, mode: this.#mode });
    copy.#style = this.#style;
    copy.#descendants = new Map(this.#descendants);
    return copy.#setColors(this.#colors);
  }

  protected override get eventTypes(): readonly (keyof ImageLayerEvents)[] {
    return ["ready", "error", "click", ...HOVER_EVENTS];
  }

  /** @internal Whether anything listens to the pointer over its objects. */
  get hovers(): boolean {
    return HOVER_EVENTS.some((type) => this.listens(type));
  }

  /** @internal */
  get needs(): readonly "id"[] {
    return this.hovers ? ["id"] : [];
  }

  /** Shows text beside the pointer while it is over an object; a function gets the object. Replaces the previous tooltip; null removes it. @throws UsageError without the entry `tooltip` */
  bindTooltip(content: TooltipContent | null): this {
    this.#unbindTooltip?.();
    this.#unbindTooltip =
      content === null ? undefined : (getPlugin("tooltip", "bindTooltip") as BindTooltip)(this, content, () => this.map?.overlayPane);
    return this.#redraw();
  }

  /** The checked manifest; undefined until it has loaded. */
  get rendering(): Rendering | undefined {
    return this.#rendering;
  }

  /** Attribution text: the option's, else the manifest's; "" before "ready". */
  get attribution(): string {
    return this.options.attribution ?? this.#rendering?.json.attribution ?? "";
  }

  /** The current mode. */
  get mode(): Mode {
    return this.#mode;
  }

  /** Sets the mode. @throws UsageError for an unknown mode; a mode whose layers the rendering lacks is reported by the map's "error" */
  setMode(mode: Mode): this {
    this.#mode = checkMode(mode);
    this.#checkLayers();
    return this.#redraw();
  }

  /** Sets the opacity, 0 to 1. */
  setOpacity(opacity: number): this {
    this.options.opacity = Math.min(Math.max(checkNumber(opacity, "opacity"), 0), 1);
    return this.#redraw();
  }

  /** Opacity, 0 to 1. */
  get opacity(): number {
    return this.options.opacity;
  }

  /** Shows the layer in a part of the map only: left, top, right, bottom in fractions of its width and height; null: everywhere. */
  setClip(clip: Clip | null): this {
    this.#clip = clip;
    return this.#redraw();
  }

  /** The part of the map where it is shown; null: everywhere. */
  get clip(): Clip | null {
    return this.#clip;
  }

  /** Highlights objects and their descendants in a colour (#rrggbb), in addition to those already highlighted. */
  highlight(ids: number | Iterable<number>, { color = this.options.highlightColor }: { color?: string } = {}): this {
    const rgb = parseColor(color);
    const colors = new Map(this.#colors);
    for (const id of typeof ids === "number" ? [ids] : ids) colors.set(id >>> 0, rgb);
    return this.#setColors(colors);
  }

  /** Removes the highlights of some objects; without ids, all highlights. */
  clearHighlight(ids?: number | Iterable<number>): this {
    const cleared = new Set(typeof ids === "number" ? [ids] : (ids ?? this.#colors.keys()));
    return this.#setColors(new Map([...this.#colors].filter(([id]) => !cleared.has(id))));
  }

  /** Ids of the highlighted objects. */
  get highlighted(): number[] {
    return [...this.#colors.keys()];
  }

  /** Tints, dims and hides objects; replaces the previous style. {} resets all. @throws UsageError for an invalid colour */
  setStyle(style: ObjectStyle): this {
    const kept = { ...style, ...(style.only && { only: [...style.only] }), ...(style.hidden && { hidden: [...style.hidden] }) };
    makeDrawStyles(kept); // fails before anything changes
    this.#style = kept;
    return this.#setColors(this.#colors);
  }

  /** @internal */
  isHidden(id: number): boolean {
    return isHidden(this.#drawStyles, id);
  }

  /** @internal The styles behind `isHidden`; null: all objects are plain. A new object after each change. */
  get drawStyles(): DrawStyles | null {
    return this.#drawStyles;
  }

  /** Returns name, class and attributes of an object; null when it is unknown. */
  async object(id: number): Promise<ObjectInfo | null> {
    return (await this.#objects?.find(id)) ?? null;
  }

  /** Lists the objects' attributes, for `column`; empty when the rendering does not list them. */
  async attributes(): Promise<readonly AttributeInfo[]> {
    return (await this.#objects?.attributes()) ?? [];
  }

  /** Returns an attribute's values by id: of all objects, or at least of some. @param ids reads only the files of these objects */
  async column({ column }: Pick<AttributeInfo, "column">, ids?: Iterable<number>): Promise<ReadonlyMap<number, AttributeValue>> {
    return (await this.#objects?.column(column, ids)) ?? new Map<number, AttributeValue>();
  }

  /** Returns statistics of an attribute; null when its values are one small file. */
  async columnSummary({ column }: Pick<AttributeInfo, "column">): Promise<ColumnSummary | null> {
    return (await this.#objects?.summary(column)) ?? null;
  }

  /** Finds objects by the words of name and address. In a large rendering, reads a few small files. */
  async search(text: string, limit?: number): Promise<readonly SearchEntry[]> {
    return (await this.#objects?.search(text, limit)) ?? [];
  }

  /** Finds objects by their name, such as a gml:id, or their label, as a whole; parts by their name. Returns their ids; none before "ready". */
  async findByName(name: string): Promise<number[]> {
    const objects = this.#objects;
    const entries = (await objects?.search(name, MOST_NAMESAKES)) ?? [];
    const found = await Promise.all(
      entries.map(async ([id, label]) => {
        if (label === name) return [id];
        const all = [id, ...((await objects?.descendants(id)) ?? [])];
        const named = await Promise.all(all.map(async (each) => (await objects?.find(each))?.name === name));
        return all.filter((_, k) => named[k]);
      }),
    );
    return found.flat();
  }

  /** Highlights the objects with a name (see `findByName`). Returns their ids. @throws UsageError when there are none */
  async highlightByName(name: string, options: { color?: string } = {}): Promise<number[]> {
    const ids = await this.findByName(name);
    if (ids.length === 0) throw new UsageError(noObject(name));
    this.highlight(ids, options);
    return ids;
  }

  protected onAdd(map: ImageLayerHost): void {
    const context = map.layerContext;
    if (!context) return; // the map has reported why
    this.#context = context;
    const failed = (error: Error): void => {
      if (this.#context !== context) return;
      if (!this.#rendering) this.loadError = error;
      this.fire("error", { error });
      context.report(error);
    };
    this.#openTiles(context, failed);
    this.source
      .manifest()
      .then((rendering) => {
        if (this.#context === context) this.#start(rendering, context);
      })
      .catch((reason: unknown) => failed(asError(reason)));
  }

  protected onRemove(): void {
    this.#context?.dropTiles(this.#name);
    this.#context = this.#tiles = this.#rendering = this.#objects = this.loadError = undefined;
  }

  /** @internal Finds the layer's view with a frame's look-at angle and pitch. */
  findView(frame: Frame): View | undefined {
    return this.#rendering && findMatchingView(this.#rendering, frame);
  }

  /** @internal Whether its manifest is loading. */
  get isLoading(): boolean {
    return !this.#rendering && !this.loadError;
  }

  /** @internal Returns the rendered light that it shows for a light; null before its manifest has loaded. */
  getBakedLight(light: Readonly<Light>): BakedLight | null {
    return this.#rendering ? this.#findBakedLight(this.#rendering, light) : null;
  }

  /** @internal Whether it can be combined with other layers by depth. */
  get isCombinable(): boolean {
    return this.options.combine && this.options.opacity > 0 && this.#rendering?.layers.has("depth") === true;
  }

  /** @internal Whether it is visible at a point (fractions of the map's width and height). */
  showsAt([x, y]: Vec2): boolean {
    const [left, top, right, bottom] = this.#clip ?? [0, 0, 1, 1];
    return this.options.opacity > 0 && x >= left && x < right && y >= top && y < bottom;
  }

  /** @internal */
  get tiles(): LayerTiles | undefined {
    return this.#tiles;
  }

  /** @internal Plans what to draw and to fetch. @param kinds read by others */
  plan(viewState: ViewState, light: Readonly<Light>, kinds: readonly LayerKind[], combined: boolean): LayerPlan | null {
    const view = this.findView(viewState.camera.frame);
    if (!view || !this.#rendering || !this.#tiles || this.options.opacity === 0) return null;
    const mode = this.#effectiveMode(this.#rendering);
    const needed = listRequiredKinds(mode, this.#needsMask(this.#rendering), combined);
    const bakedLight = this.#findBakedLight(this.#rendering, light);
    const ids: LayerKind[] = this.#shownColors.size > 0 || this.#drawStyles ? ["id"] : [];
    const read = [...new Set([...ids, ...kinds])].filter((kind) => !needed.includes(kind));
    const extra = [...(light.lit ? listBakedLightKinds(mode, bakedLight) : []), ...read];
    return planLayer(viewState, this.#rendering, view, this.#tiles, {
      bakedLight,
      layers: withShadowLayer(this.#rendering, bakedLight),
      needed,
      extra,
    });
  }

  /** @internal Makes its pass of a frame. @param before number of combined layers added before it; null: it is not combined */
  makePass(plan: LayerPlan, { origin }: ViewState, before: number | null): LayerPass {
    const rendering = this.#rendering as Rendering;
    return {
      mode: this.#effectiveMode(rendering),
      level: plan.level,
      quads: plan.quads,
      tiles: this.#makeTileAccess(plan.view, plan.layers),
      bakedLight: plan.bakedLight,
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
    this.#findDescendants();
    return this.#applyStyle();
  }

  #applyStyle(): this {
    this.#drawStyles = makeDrawStyles(this.#style, this.#descendants);
    const all = new Map(this.#colors);
    inherit(all, this.#descendants);
    this.#shownColors = new Map([...all].filter(([id]) => !this.isHidden(id)));
    return this.#redraw();
  }

  /** Fetches the descendants of highlighted and styled objects, once, and shows them when they are known. */
  #findDescendants(): void {
    const [objects, known] = [this.#objects, this.#descendants];
    const missing = [...new Set([...this.#colors.keys(), ...listStyledIds(this.#style)])]
      .filter((id) => !known.has(id))
      .sort((a, b) => a - b);
    if (!objects || missing.length === 0) return;
    for (const id of missing) known.set(id, []);
    const find = async (): Promise<void> => {
      const found = [];
      for (const id of missing) {
        const below = await objects.descendants(id);
        if (below.length > 0) found.push([id, below] as const);
      }
      for (const [id, below] of found) known.set(id, below);
      if (found.length > 0) this.#applyStyle();
    };
    find().catch((reason: unknown) => {
      for (const id of missing) known.delete(id);
      this.#context?.report(asError(reason));
    });
  }

  #start(rendering: Rendering, context: LayerContext): void {
    this.#show(rendering, context);
    this.fire("ready", { rendering });
  }

  #show(rendering: Rendering, context: LayerContext): void {
    context.checkCompatible(rendering);
    this.#rendering = rendering;
    this.#objects = new Objects(this.source, rendering.json);
    this.#findDescendants();
    context.onManifest(rendering);
    this.#checkLayers();
  }

  #openTiles(context: LayerContext, failed: (error: Error) => void): void {
    this.#name = context.createName();
    const tiles = new LayerTiles(this.#name, this.source, context.tileResources, (error) => {
      if (tiles !== this.#tiles) return;
      if (error && isGone(error)) this.#renew(context, error, failed).catch(failed);
      else if (error) failed(error);
      context.requestFrame();
    });
    this.#tiles = tiles;
  }

  /** Shows the publication that has replaced the one whose file is gone. @param failed called with the error when there is none */
  async #renew(context: LayerContext, error: Error, failed: (error: Error) => void): Promise<void> {
    const before = this.#rendering;
    const rendering = await this.source.manifest(undefined, true);
    if (this.#context !== context || this.#rendering !== before) return;
    if (rendering.json.content_version === before?.json.content_version) {
      failed(error);
      return;
    }
    context.dropTiles(this.#name);
    this.#openTiles(context, failed);
    this.#show(rendering, context);
  }

  #checkLayers(): void {
    const [rendering, context] = [this.#rendering, this.#context];
    if (!rendering || !context) return;
    const missing = listRequiredKinds(this.#effectiveMode(rendering), this.#needsMask(rendering), false).filter(
      (kind) => !rendering.layers.has(kind),
    );
    if (missing.length > 0)
      context.report(
        new UsageError(`mode "${this.#mode}" needs the layer ${missing.join(", ")}, which the rendering "${rendering.json.name}" lacks`),
      );
  }

  /** Without normals, "lit" falls back to "color". */
  #effectiveMode(rendering: Rendering): Mode {
    return this.#mode === "lit" && !rendering.layers.has("normal") ? "color" : this.#mode;
  }

  #needsMask(rendering: Rendering): boolean {
    return rendering.layers.get(this.#mode === "picture" ? "picture" : "color")?.format === "jpeg";
  }

  /** Finds the rendered light that matches a light. */
  #findBakedLight({ layers, json }: Rendering, light: Readonly<Light>): BakedLight {
    const shadow = light.shadows && light.elevation_deg > 0 ? findShadow(json.layers, towardsLight(light)) : null;
    return { shadow, occlusion: light.occlusion && layers.has("ao") };
  }

  #makeTileAccess(view: View, layers: ReadonlyMap<string, LayerInfo>): TileAccess {
    const tiles = this.#tiles as LayerTiles;
    const stored = (kind: LayerKind, tile: Tile): ReturnType<LayerTiles["get"]> => {
      const layer = layers.get(kind);
      return layer && tiles.get(view, layer, tile);
    };
    return {
      key: (kind, tile) => {
        const layer = layers.get(kind);
        return layer ? tiles.key(view, layer, tile) : "";
      },
      data: (kind, tile) => stored(kind, tile)?.data,
      onUploaded: (kind, tile) => {
        if (kind !== "id" && kind !== "depth") tiles.releaseData(view, layers.get(kind), tile);
      },
    };
  }

  #redraw(): this {
    this.#context?.requestFrame();
    return this;
  }
}

/** Returns a rendering's layers by kind, with the given layer of shadows. */
function withShadowLayer({ layers }: Rendering, { shadow }: BakedLight): ReadonlyMap<string, LayerInfo> {
  return shadow && layers.get(shadow.layer.kind) !== shadow.layer ? new Map([...layers, [shadow.layer.kind, shadow.layer]]) : layers;
}

function checkMode(mode: Mode): Mode {
  if (!MODES.includes(mode)) throw new UsageError(`unknown mode "${mode}"; use one of ${MODES.join(", ")}`);
  return mode;
}

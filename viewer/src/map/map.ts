import { adoptStyles, element } from "../core/dom";
import { asError, UsageError } from "../core/errors";
import { Evented } from "../core/events";
import type { Addable, LayerHost, OverlayHost, OverlayEvents } from "../core/overlayHost";
import type { Vec2, Vec3 } from "../core/vec";
import { findLanguage } from "../core/i18n";
import type { CustomLayer } from "../draw/drawer";
import type { Camera } from "../geo/camera";
import { computeDaylight } from "../geo/daylight";
import { DEFAULT_LIGHT, validLight, type Light } from "../geo/light";
import type { LightEstimator } from "../draw/lightEstimator";
import type { LayerKind } from "../geo/manifest";
import { marker } from "../overlay/marker";
import { attributionLine } from "../ui/attribution";
import { controls } from "../ui/controls";
import { scaleBar } from "../ui/scaleBar";
import { DebugTiles } from "../ui/debugTiles";
import { STYLES } from "../ui/styles";
import { FrameLoop } from "./frameLoop";
import { Gestures, type GestureTarget } from "./gestures";
import { imageLayer } from "./imageLayer";
import { objectsIn, type VisibleObject } from "./inView";
import { listenToKeys } from "./keyboard";
import { DEFAULTS, savesData, type ClickEvent, type FilledOptions, type MapOptions } from "./options";
import { Painter } from "./painter";
import { NOTHING, pickExactly, pickLoaded, type Pick } from "./picker";
import { Relief } from "./relief";
import type { ViewState, LayerContext } from "./layerContext";
import { CameraController } from "./cameraController";
import { Viewport, type Size } from "./viewport";
import type { Rect } from "../tiles/cover";

/** A map in a canvas of the page. World coordinates are those of the scene's CRS, in metres. */
export class map extends CameraController implements OverlayHost, LayerHost<map>, GestureTarget {
  readonly options: FilledOptions;
  /** Tells markers and popups that places on the screen have changed. */
  readonly frameEvents = new Evented<OverlayEvents>();
  readonly #viewport: Viewport;
  readonly #painter: Painter | null;
  readonly #loop = new FrameLoop((now) => { this.#frame(now); });
  readonly #items = new Set<Addable<map>>();
  readonly #ending = new AbortController();
  readonly #debug = new DebugTiles();
  #gestures: Gestures | undefined;
  #layers: imageLayer[] = [];
  #light: Readonly<Light>;
  #time: Date | null = null;
  #drawn: Camera | undefined;
  #relief: Relief | undefined;
  #shade: LightEstimator | null = null;
  /** Something besides the camera has changed since the last frame. */
  #dirty = true;
  /** The picture has not moved since the last "moveend". */
  #resting = true;
  #loaded = false;
  #clicks = 0;
  #names = 0;
  #hover: Vec2 | null = null;

  /** @param target the id of a canvas, or the element  @throws UsageError when there is none */
  constructor(target: string | HTMLElement, options: MapOptions = {}) {
    super();
    const { dataSaver = DEFAULTS.dataSaver } = options;
    this.options = { ...DEFAULTS, ...options, dataSaver: dataSaver === "auto" ? savesData() : dataSaver };
    const spared = this.options.dataSaver ? { shadows: false, occlusion: false } : {};
    this.#light = validLight({ ...DEFAULT_LIGHT, ...spared, ...options.light });
    adoptStyles(document, STYLES);
    this.#viewport = new Viewport(target, () => { this.#resized(); });
    if (options.background !== undefined) this.setBackground(options.background);
    this.#painter = this.#makePainter();
    this.#listen();
    this.#dress();
  }

  // Things on the map

  /** Puts a layer, marker or popup on the map. */
  add(item: Addable<map>): this {
    if (this.#items.has(item)) return this;
    this.#items.add(item);
    if (item instanceof imageLayer) this.#layers = [...this.#layers, item];
    if (item instanceof marker) item.on("select", this.#selected);
    item.attachTo(this);
    return this.#redraw();
  }

  /** Takes a layer, marker or popup off the map. */
  discard(item: Addable<map>): this {
    if (!this.#items.delete(item)) return this;
    this.#layers = this.#layers.filter((layer) => layer !== item);
    if (item instanceof marker) item.off("select", this.#selected);
    item.detachFrom(this);
    return this.#redraw();
  }

  /** Ends the map; the canvas stands in the page as before. */
  remove(): this {
    this.#loop.stop();
    this.#ending.abort();
    for (const item of [...this.#items]) this.discard(item);
    this.#painter?.destroy();
    this.#viewport.destroy();
    return this.fire("remove", {});
  }

  /** Its image layers, the lowest first. */
  get layers(): readonly imageLayer[] {
    return this.#layers;
  }

  /** Whose data is shown. */
  get attributions(): readonly string[] {
    return [...new Set(this.#layers.map(({ attribution }) => attribution).filter((text) => text !== ""))];
  }

  /** @internal Markers on it. */
  get markers(): readonly marker[] {
    return [...this.#items].filter((item) => item instanceof marker);
  }

  /** What the canvas lies in, with markers, popups and controls. */
  get container(): HTMLElement {
    return this.#viewport.container;
  }

  /** The one that is there now: when WebGL is lost for good, another takes its place. */
  get canvas(): HTMLCanvasElement {
    return this.#viewport.canvas;
  }

  /** What draws: "webgl" or "canvas"; null when nothing can. */
  get drawer(): "webgl" | "canvas" | null {
    return this.#painter?.drawer.name ?? null;
  }

  /** @internal What the picture is seen in: the canvas, or an element below it; null when nothing can be drawn. */
  get drawerElement(): HTMLElement | null {
    return this.#painter?.drawer.element ?? null;
  }

  get language(): string {
    return this.options.language ?? findLanguage(this.container);
  }

  get overlayPane(): HTMLElement {
    return this.#viewport.overlayPane;
  }

  /** @internal Holds buttons. */
  get controlPane(): HTMLElement {
    return this.#viewport.controlPane;
  }

  // Looks

  /** What the picture is lit by. */
  get light(): Readonly<Light> {
    return this.#light;
  }

  /** Changes parts of the light; numbers are brought into their ranges. Another direction ends the light of a time. */
  setLight(light: Partial<Light>): this {
    if (light.azimuth_deg !== undefined || light.altitude_deg !== undefined) this.#time = null;
    return this.#relight(light);
  }

  /** The time that the light is of; null when it was set otherwise. */
  get time(): Date | null {
    return this.#time;
  }

  /** Light of a moment at the scene's place, with the colours of the day, and shadows where the rendering has them. */
  setTime(time: Date): this {
    return this.whenReady((_, { json }) => {
      if (!json.geographic) throw new UsageError(`rendering "${json.name}" does not say where on earth it lies, so the sun's place is not known; use setLight`);
      this.#time = time;
      this.#relight(computeDaylight(time, json.geographic));
    });
  }

  /** @internal What finds light that was not rendered. */
  setLightEstimator(shade: LightEstimator | null): this {
    this.#shade = shade;
    return this.#redraw();
  }

  /** Any CSS background; the same as the custom property --map3d-background. */
  setBackground(background: string): this {
    this.container.style.setProperty("--map3d-background", background);
    return this;
  }

  /** Outlines and names of the tiles that are shown. */
  debug(on = true): this {
    this.#debug.show(on);
    return this.#redraw();
  }

  #relight(light: Partial<Light>): this {
    this.#light = validLight({ ...this.#light, ...light });
    this.fire("lightchange", { light: this.#light });
    return this.#redraw();
  }

  // Asking

  /** What lies under CSS pixels, exactly: the deepest level's tile is fetched. Approximate when that fails. */
  async pick(point: Vec2): Promise<Pick> {
    const sight = this.getViewState();
    if (!sight) return NOTHING;
    try {
      return await pickExactly(this.#layers, sight, point);
    } catch {
      // The tile's own error has been reported when it failed.
      return { ...(pickLoaded(this.#layers, sight, point) ?? NOTHING), approximate: true };
    }
  }

  /** Objects of all layers that are seen, the largest of each layer first; those below the topmost layer count as if they were not hidden by it. */
  async objectsInView(): Promise<readonly (VisibleObject & { readonly layer: imageLayer })[]> {
    const sight = this.getViewState();
    if (!sight) return [];
    const found = await Promise.all([...this.#layers].reverse().map(async (layer) => (await objectsIn(layer, sight)).map((seen) => ({ ...seen, layer }))));
    return found.flat();
  }

  /** What the tiles in memory tell of a point; null when they tell nothing. */
  pickLoaded(point: Vec2): Pick | null {
    const sight = this.getViewState();
    return sight && pickLoaded(this.#layers, sight, point);
  }

  isOccluded(world: Vec3): boolean {
    return this.relief?.covers(world) ?? false;
  }

  findSurfaceAt(point: Vec2): Vec3 | null {
    return this.relief?.positionAt(point) ?? null;
  }

  /** @internal Depths of the picture that was drawn last, of items that need them; null before "ready". */
  get relief(): Relief | null {
    const sight = this.getViewState();
    if (this.#relief?.camera !== sight?.camera) this.#relief = undefined;
    this.#relief ??= sight ? new Relief(this.#layers, sight) : undefined;
    return this.#relief ?? null;
  }

  /** @internal Depths of a rectangle (U and V), from the deepest level that takes at most so many tiles; `ids`: object ids, too. */
  fetchRelief(sight: ViewState, rect: Rect, most: number, ids = false): ReturnType<typeof Relief.fetch> {
    return Relief.fetch(this.#layers, sight, rect, most, ids);
  }

  /** Bytes of decoded tiles in memory. */
  get cacheBytes(): number {
    return this.#painter?.cacheBytes ?? 0;
  }

  // What gestures and layers call

  /** @internal */
  tap(point: Vec2): void {
    this.#deselectMarkers();
    void this.#click(point);
  }

  /** @internal */
  hover(point: Vec2): void {
    if (!this.listens("mousemove")) return;
    this.#hover = point;
    this.#loop.request();
  }

  /** @internal Something else is seen among the layers by its depth; `on` false: no longer. */
  toggleCustomLayer(guest: CustomLayer, on = true): this {
    this.#painter?.customLayers[on ? "add" : "delete"](guest);
    return this.#redraw();
  }

  /** @internal undefined when the map cannot draw. */
  get layerContext(): LayerContext | undefined {
    const painter = this.#painter;
    return painter === null ? undefined : {
      tileResources: painter.shared,
      createName: () => `layer${String(this.#names++)}`,
      dropTiles: (layer) => { painter.forget(`${layer}/`); },
      checkCompatible: (rendering) => { this.admit(rendering); },
      onManifest: (rendering) => {
        if (!this.camera) this.begin(rendering);
        this.#redraw();
      },
      requestFrame: () => { this.#redraw(); },
      report: (error) => { this.report(error); },
    };
  }

  protected get size(): Size {
    return this.#viewport.size;
  }

  protected requestFrame(): void {
    this.#loop.request();
  }

  protected surfaceInTheMiddle(sight: ViewState): Vec3 | null {
    return pickLoaded(this.#layers, sight, this.middle())?.position ?? null;
  }

  protected report(error: Error): void {
    if (this.listens("error")) this.fire("error", { error });
    else console.warn(`map3d: ${error.message}`);
  }

  // Frames

  #frame(now: number): void {
    const turned = this.transitionCamera !== null;
    this.stepCamera(now);
    if (this.#hover) this.#fireHover(this.#hover);
    try {
      if (this.#dirty || this.camera !== this.#drawn || turned || this.transitionCamera) this.#draw(turned || this.transitionCamera !== null);
      else this.#settle();
    } catch (reason) {
      this.report(asError(reason));
    }
  }

  /** @param turning places on the screen are others even when the camera is not */
  #draw(turning: boolean): void {
    const sight = this.getViewState();
    if (!sight || !this.#painter || this.size.width === 0) return;
    const [before, changed] = [this.#drawn, this.#dirty];
    [this.#drawn, this.#dirty, this.#relief] = [sight.camera, false, undefined];
    const moving = before !== undefined && before !== sight.camera;
    const { plans, complete } = this.#painter.paint(sight, { layers: this.#layers, light: this.#light, kinds: this.#kindsRead(), shade: this.#shade, moving }, this.transitionCamera && ((scene) => { this.transition?.draw({ ...scene, camera: sight.camera, changed }); }));
    this.#debug.update(plans, sight.dpr, this.#painter.drawer);
    if (before !== sight.camera || turning) this.#moved(before, sight.camera);
    this.frameEvents.fire("draw", {});
    if (this.#shade && moving) this.#redraw();
    if (this.moving || !this.#resting || complete) this.#loop.request();
    if (complete) this.#complete();
  }

  /** Layers that somebody reads, besides those that are shown. */
  #kindsRead(): LayerKind[] {
    return [...new Set([...(this.options.hover && !this.options.dataSaver ? ["id" as const] : []), ...[...this.#items].flatMap(({ needs }) => needs ?? [])])];
  }

  #moved(before: Camera | undefined, { zoom }: Camera): void {
    this.#resting = false;
    this.frameEvents.fire("move", {});
    this.fire("move", {});
    if (before?.zoom !== zoom) this.fire("zoom", { zoom });
  }

  #complete(): void {
    if (this.#loaded) return;
    this.#loaded = true;
    this.fire("load", {});
  }

  /** Nothing is left to draw. */
  #settle(): void {
    if (this.moving) {
      this.#loop.request();
      return;
    }
    if (!this.#resting) this.fire("moveend", {});
    this.#resting = true;
    if (!this.#painter?.busy && this.#loaded) this.fire("idle", {});
  }

  #redraw(): this {
    this.#dirty = true;
    // Until the first picture is whole, what has come is to be passed on at once. WebGL must not run ahead of what the GPU can do.
    this.#loop.request(!this.#loaded && this.drawer === "canvas" && !document.hidden);
    return this;
  }

  #resized(): void {
    const { width, height } = this.size;
    if (this.camera && (this.camera.width !== width || this.camera.height !== height)) this.setCamera({ ...this.camera, width, height });
    this.fire("resize", { width, height });
    this.#redraw();
  }

  // Making

  #makePainter(): Painter | null {
    try {
      return new Painter(this.#viewport, this.options, {
        lost: () => this.fire("contextlost", {}),
        restored: () => this.fire("contextrestored", {}).#redraw(),
        replaced: () => {
          this.#steer();
          this.fire("contextrestored", {}).#redraw();
        },
        changed: () => this.#redraw(),
        failed: (error) => { this.report(error); },
      });
    } catch (reason) {
      const error = asError(reason);
      this.container.append(element("p", "map3d-message", { role: "alert" }, error.message));
      queueMicrotask(() => { this.report(error); });
      return null;
    }
  }

  #dress(): void {
    const { controlPane, overlayPane } = this.#viewport;
    overlayPane.append(this.#debug.pane);
    if (this.options.controls) controlPane.append(controls(this), scaleBar(this));
    if (this.options.attribution) controlPane.append(attributionLine(this));
  }

  #listen(): void {
    const { signal } = this.#ending;
    this.#steer();
    signal.addEventListener("abort", () => { this.#gestures?.destroy(); });
    listenToKeys(this, signal);
    window.addEventListener("online", () => { this.#retry(); }, { signal });
  }

  /** Listens to hands on the canvas that is there now. */
  #steer(): void {
    this.#gestures?.destroy();
    this.#gestures = new Gestures(this, this.canvas);
  }

  #retry(): void {
    for (const layer of this.#layers) layer.tiles?.forgive();
    this.#redraw();
  }

  // Events

  #deselectMarkers(but?: marker): void {
    for (const item of this.#items) if (item instanceof marker && item !== but) item.select(false);
  }

  readonly #selected = ({ marker: chosen }: { marker: marker }): void => {
    this.#deselectMarkers(chosen);
    this.fire("select", { marker: chosen });
  };

  #fireHover(point: Vec2): void {
    this.#hover = null;
    this.fire("mousemove", { ...(this.pickLoaded(point) ?? NOTHING), point });
  }

  async #click(point: Vec2): Promise<void> {
    const number = ++this.#clicks;
    this.fire("preclick", { ...(this.pickLoaded(point) ?? { ...NOTHING, approximate: true }), point });
    const pick = await this.pick(point);
    const event = await this.#described({ ...pick, point });
    if (number === this.#clicks && !this.#ending.signal.aborted) this.fire("click", event);
  }

  async #described(event: ClickEvent): Promise<ClickEvent> {
    try {
      const object = await event.layer?.object(event.id);
      return object ? { ...event, name: object.name, class: object.class, attributes: object.attributes } : event;
    } catch (reason) {
      this.report(asError(reason));
      return event;
    }
  }
}

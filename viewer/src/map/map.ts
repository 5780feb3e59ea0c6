import { adoptStyles, element } from "../core/dom";
import { asError, UsageError } from "../core/errors";
import { Evented } from "../core/events";
import type { Addable, LayerHost } from "../core/mapLayer";
import type { OverlayHost, OverlayEvents } from "../core/overlayHost";
import type { Vec2, Vec3 } from "../core/vec";
import { findLanguage } from "../core/i18n";
import type { CustomLayer } from "../draw/drawer";
import type { Camera } from "../geo/camera";
import { computeDaylight } from "../geo/daylight";
import { DEFAULT_LIGHT, clampLight, type Light } from "../geo/light";
import type { LightEstimator } from "../draw/lightEstimator";
import type { LayerKind } from "../geo/manifest";
import { marker } from "../overlay/marker";
import { createAttribution } from "../ui/attribution";
import { createControls } from "../ui/controls";
import { createScaleBar } from "../ui/scaleBar";
import { DebugTiles } from "../ui/debugTiles";
import { STYLES } from "../ui/styles";
import { FrameLoop } from "./frameLoop";
import { Gestures, type GestureTarget } from "./gestures";
import { imageLayer } from "./imageLayer";
import { findVisibleObjects, type VisibleObject } from "./visibleObjects";
import { listenToKeys } from "./keyboard";
import { DEFAULTS, savesData, type ClickEvent, type FilledOptions, type MapOptions } from "./options";
import { FrameRenderer } from "./frameRenderer";
import { EMPTY_PICK, pickExactly, pickLoaded, type Pick } from "./picker";
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
  readonly #renderer: FrameRenderer | null;
  readonly #loop = new FrameLoop((now) => { this.#frame(now); });
  readonly #items = new Set<Addable<map>>();
  readonly #abort = new AbortController();
  readonly #debug = new DebugTiles();
  #gestures: Gestures | undefined;
  #layers: imageLayer[] = [];
  #light: Readonly<Light>;
  #time: Date | null = null;
  #drawnCamera: Camera | undefined;
  #relief: Relief | undefined;
  #lightEstimator: LightEstimator | null = null;
  /** Something besides the camera has changed since the last frame. */
  #dirty = true;
  /** The picture has not moved since the last "moveend". */
  #atRest = true;
  #loaded = false;
  #clickCount = 0;
  #nameCount = 0;
  #hoverPoint: Vec2 | null = null;

  /** @param target the id of a canvas, or the element  @throws UsageError when there is none */
  constructor(target: string | HTMLElement, options: MapOptions = {}) {
    super();
    const { dataSaver = DEFAULTS.dataSaver } = options;
    this.options = { ...DEFAULTS, ...options, dataSaver: dataSaver === "auto" ? savesData() : dataSaver };
    const spared = this.options.dataSaver ? { shadows: false, occlusion: false } : {};
    this.#light = clampLight({ ...DEFAULT_LIGHT, ...spared, ...options.light });
    adoptStyles(document, STYLES);
    this.#viewport = new Viewport(target, () => { this.#onResize(); });
    if (options.background !== undefined) this.setBackground(options.background);
    this.#renderer = this.#createRenderer();
    this.#addListeners();
    this.#addControls();
  }

  // Things on the map

  /** Puts a layer, marker or popup on the map. */
  add(item: Addable<map>): this {
    if (this.#items.has(item)) return this;
    this.#items.add(item);
    if (item instanceof imageLayer) this.#layers = [...this.#layers, item];
    if (item instanceof marker) item.on("select", this.#onMarkerSelect);
    item.attachTo(this);
    return this.#redraw();
  }

  /** Takes a layer, marker or popup off the map. */
  discard(item: Addable<map>): this {
    if (!this.#items.delete(item)) return this;
    this.#layers = this.#layers.filter((layer) => layer !== item);
    if (item instanceof marker) item.off("select", this.#onMarkerSelect);
    item.detachFrom(this);
    return this.#redraw();
  }

  /** Ends the map; the canvas stands in the page as before. */
  remove(): this {
    this.#loop.stop();
    this.#abort.abort();
    for (const item of [...this.#items]) this.discard(item);
    this.#renderer?.destroy();
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
    return this.#renderer?.drawer.name ?? null;
  }

  /** @internal What the picture is seen in: the canvas, or an element below it; null when nothing can be drawn. */
  get drawerElement(): HTMLElement | null {
    return this.#renderer?.drawer.element ?? null;
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
    return this.#updateLight(light);
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
      this.#updateLight(computeDaylight(time, json.geographic));
    });
  }

  /** @internal What finds light that was not rendered. */
  setLightEstimator(shade: LightEstimator | null): this {
    this.#lightEstimator = shade;
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

  #updateLight(light: Partial<Light>): this {
    this.#light = clampLight({ ...this.#light, ...light });
    this.fire("lightchange", { light: this.#light });
    return this.#redraw();
  }

  // Asking

  /** What lies under CSS pixels, exactly: the deepest level's tile is fetched. Approximate when that fails. */
  async pick(point: Vec2): Promise<Pick> {
    const viewState = this.getViewState();
    if (!viewState) return EMPTY_PICK;
    try {
      return await pickExactly(this.#layers, viewState, point);
    } catch {
      // The tile's own error has been reported when it failed.
      return { ...(pickLoaded(this.#layers, viewState, point) ?? EMPTY_PICK), approximate: true };
    }
  }

  /** Objects of all layers that are seen, the largest of each layer first; those below the topmost layer count as if they were not hidden by it. */
  async objectsInView(): Promise<readonly (VisibleObject & { readonly layer: imageLayer })[]> {
    const viewState = this.getViewState();
    if (!viewState) return [];
    const found = await Promise.all([...this.#layers].reverse().map(async (layer) => (await findVisibleObjects(layer, viewState)).map((seen) => ({ ...seen, layer }))));
    return found.flat();
  }

  /** What the tiles in memory tell of a point; null when they tell nothing. */
  pickLoaded(point: Vec2): Pick | null {
    const viewState = this.getViewState();
    return viewState && pickLoaded(this.#layers, viewState, point);
  }

  isOccluded(world: Vec3): boolean {
    return this.relief?.isPositionOccluded(world) ?? false;
  }

  findSurfaceAt(point: Vec2): Vec3 | null {
    return this.relief?.positionAt(point) ?? null;
  }

  /** @internal Depths of the picture that was drawn last, of items that need them; null before "ready". */
  get relief(): Relief | null {
    const viewState = this.getViewState();
    if (this.#relief?.camera !== viewState?.camera) this.#relief = undefined;
    this.#relief ??= viewState ? new Relief(this.#layers, viewState) : undefined;
    return this.#relief ?? null;
  }

  /** @internal Depths of a rectangle (U and V), from the deepest level that takes at most so many tiles; `ids`: object ids, too. */
  fetchRelief(viewState: ViewState, rect: Rect, most: number, ids = false): ReturnType<typeof Relief.fetch> {
    return Relief.fetch(this.#layers, viewState, rect, most, ids);
  }

  /** Bytes of decoded tiles in memory. */
  get cacheBytes(): number {
    return this.#renderer?.cacheBytes ?? 0;
  }

  // What gestures and layers call

  /** @internal */
  tap(point: Vec2): void {
    this.#deselectMarkers();
    void this.#fireClick(point);
  }

  /** @internal */
  hover(point: Vec2): void {
    if (!this.listens("mousemove")) return;
    this.#hoverPoint = point;
    this.#loop.request();
  }

  /** @internal Something else is seen among the layers by its depth; `on` false: no longer. */
  toggleCustomLayer(guest: CustomLayer, on = true): this {
    this.#renderer?.customLayers[on ? "add" : "delete"](guest);
    return this.#redraw();
  }

  /** @internal undefined when the map cannot draw. */
  get layerContext(): LayerContext | undefined {
    const painter = this.#renderer;
    return painter === null ? undefined : {
      tileResources: painter.tileResources,
      createName: () => `layer${String(this.#nameCount++)}`,
      dropTiles: (layer) => { painter.dropTiles(`${layer}/`); },
      checkCompatible: (rendering) => { this.checkCompatible(rendering); },
      onManifest: (rendering) => {
        if (!this.camera) this.initializeView(rendering);
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

  protected findCenterSurface(viewState: ViewState): Vec3 | null {
    return pickLoaded(this.#layers, viewState, this.screenCenter())?.position ?? null;
  }

  protected report(error: Error): void {
    if (this.listens("error")) this.fire("error", { error });
    else console.warn(`map3d: ${error.message}`);
  }

  // Frames

  #frame(now: number): void {
    const turned = this.transitionCamera !== null;
    this.advanceCamera(now);
    if (this.#hoverPoint) this.#fireHover(this.#hoverPoint);
    try {
      if (this.#dirty || this.camera !== this.#drawnCamera || turned || this.transitionCamera) this.#draw(turned || this.transitionCamera !== null);
      else this.#comeToRest();
    } catch (reason) {
      this.report(asError(reason));
    }
  }

  /** @param turning places on the screen are others even when the camera is not */
  #draw(turning: boolean): void {
    const viewState = this.getViewState();
    if (!viewState || !this.#renderer || this.size.width === 0) return;
    const [before, tilesChanged] = [this.#drawnCamera, this.#dirty];
    [this.#drawnCamera, this.#dirty, this.#relief] = [viewState.camera, false, undefined];
    const moving = before !== undefined && before !== viewState.camera;
    const { plans, complete } = this.#renderer.render(viewState, { layers: this.#layers, light: this.#light, requiredKinds: this.#findRequiredKinds(), lightEstimator: this.#lightEstimator, moving }, this.transitionCamera && ((scene) => { this.transition?.draw({ ...scene, camera: viewState.camera, tilesChanged }); }));
    this.#debug.update(plans, viewState.dpr, this.#renderer.drawer);
    if (before !== viewState.camera || turning) this.#fireMove(before, viewState.camera);
    this.frameEvents.fire("draw", {});
    if (this.#lightEstimator && moving) this.#redraw();
    if (this.moving || !this.#atRest || complete) this.#loop.request();
    if (complete) this.#fireLoad();
  }

  /** Layers that somebody reads, besides those that are shown. */
  #findRequiredKinds(): LayerKind[] {
    return [...new Set([...(this.options.hover && !this.options.dataSaver ? ["id" as const] : []), ...[...this.#items].flatMap(({ needs }) => needs ?? [])])];
  }

  #fireMove(before: Camera | undefined, { zoom }: Camera): void {
    this.#atRest = false;
    this.frameEvents.fire("move", {});
    this.fire("move", {});
    if (before?.zoom !== zoom) this.fire("zoom", { zoom });
  }

  #fireLoad(): void {
    if (this.#loaded) return;
    this.#loaded = true;
    this.fire("load", {});
  }

  /** Nothing is left to draw. */
  #comeToRest(): void {
    if (this.moving) {
      this.#loop.request();
      return;
    }
    if (!this.#atRest) this.fire("moveend", {});
    this.#atRest = true;
    if (!this.#renderer?.busy && this.#loaded) this.fire("idle", {});
  }

  #redraw(): this {
    this.#dirty = true;
    // Until the first picture is whole, what has come is to be passed on at once. WebGL must not run ahead of what the GPU can do.
    this.#loop.request(!this.#loaded && this.drawer === "canvas" && !document.hidden);
    return this;
  }

  #onResize(): void {
    const { width, height } = this.size;
    if (this.camera && (this.camera.width !== width || this.camera.height !== height)) this.setCamera({ ...this.camera, width, height });
    this.fire("resize", { width, height });
    this.#redraw();
  }

  // Making

  #createRenderer(): FrameRenderer | null {
    try {
      return new FrameRenderer(this.#viewport, this.options, {
        lost: () => this.fire("contextlost", {}),
        restored: () => this.fire("contextrestored", {}).#redraw(),
        replaced: () => {
          this.#listenToGestures();
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

  #addControls(): void {
    const { controlPane, overlayPane } = this.#viewport;
    overlayPane.append(this.#debug.pane);
    if (this.options.controls) controlPane.append(createControls(this), createScaleBar(this));
    if (this.options.attribution) controlPane.append(createAttribution(this));
  }

  #addListeners(): void {
    const { signal } = this.#abort;
    this.#listenToGestures();
    signal.addEventListener("abort", () => { this.#gestures?.destroy(); });
    listenToKeys(this, signal);
    window.addEventListener("online", () => { this.#retryFailedTiles(); }, { signal });
  }

  /** Listens to hands on the canvas that is there now. */
  #listenToGestures(): void {
    this.#gestures?.destroy();
    this.#gestures = new Gestures(this, this.canvas);
  }

  #retryFailedTiles(): void {
    for (const layer of this.#layers) layer.tiles?.clearFailures();
    this.#redraw();
  }

  // Events

  #deselectMarkers(but?: marker): void {
    for (const item of this.#items) if (item instanceof marker && item !== but) item.select(false);
  }

  readonly #onMarkerSelect = ({ marker: chosen }: { marker: marker }): void => {
    this.#deselectMarkers(chosen);
    this.fire("select", { marker: chosen });
  };

  #fireHover(point: Vec2): void {
    this.#hoverPoint = null;
    this.fire("mousemove", { ...(this.pickLoaded(point) ?? EMPTY_PICK), point });
  }

  async #fireClick(point: Vec2): Promise<void> {
    const number = ++this.#clickCount;
    this.fire("preclick", { ...(this.pickLoaded(point) ?? { ...EMPTY_PICK, approximate: true }), point });
    const pick = await this.pick(point);
    const event = await this.#addAttributes({ ...pick, point });
    if (number === this.#clickCount && !this.#abort.signal.aborted) this.fire("click", event);
  }

  async #addAttributes(event: ClickEvent): Promise<ClickEvent> {
    try {
      const object = await event.layer?.object(event.id);
      return object ? { ...event, name: object.name, class: object.class, attributes: object.attributes } : event;
    } catch (reason) {
      this.report(asError(reason));
      return event;
    }
  }
}

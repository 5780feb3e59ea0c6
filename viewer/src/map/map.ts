import { adoptStyles, element } from "../core/dom";
import { asError } from "../core/errors";
import { Evented } from "../core/events";
import type { Addable, LayerHost } from "../core/mapLayer";
import { checkPosition, type AnyPosition } from "../core/position";
import type { OverlayHost, OverlayEvents } from "../core/overlayHost";
import type { Vec2, Vec3 } from "../core/vec";
import { findLanguage } from "../core/i18n";
import type { CustomLayer } from "../draw/drawer";
import type { Camera } from "../geo/camera";
import type { Light } from "../geo/light";
import type { LightEstimator } from "../draw/lightEstimator";
import type { Rendering } from "../geo/manifest";
import type { Marker } from "../overlay/marker";
import { STYLES } from "../ui/styles";
import { FrameLoop } from "./frameLoop";
import { Gestures, type GestureTarget } from "./gestures";
import type { ImageLayer } from "./imageLayer";
import { findAllVisibleObjects, type VisibleObject } from "./visibleObjects";
import { listenToKeys } from "./keyboard";
import type { LayerPlan } from "./layerPlan";
import { MapItems } from "./mapItems";
import { MapLight, checkTime } from "./mapLight";
import { fillMapOptions, type FilledOptions, type MapOptions } from "./options";
import { FrameRenderer, type PlanInput } from "./frameRenderer";
import { EMPTY_PICK, pick, pickLoaded, type Pick } from "./picker";
import { PointerEvents } from "./pointerEvents";
import { VisibleDepths } from "./visibleDepths";
import { findPosition } from "./findPosition";
import type { ViewState, LayerContext } from "./layerContext";
import { addControls } from "./addControls";
import { CameraController } from "./cameraController";
import { Viewport, type Size } from "./viewport";
import type { Rect } from "../tiles/cover";

/** A map in a canvas of the page. World coordinates are those of the scene's CRS, in metres. */
export class Map3D extends CameraController implements OverlayHost, LayerHost<Map3D>, GestureTarget {
  readonly options: FilledOptions;
  /** Events after which markers and popups update their positions. */
  readonly frameEvents = new Evented<OverlayEvents>();
  readonly #viewport: Viewport;
  readonly #renderer: FrameRenderer | null;
  readonly #loop = new FrameLoop((now) => this.#frame(now));
  readonly #items = new MapItems<Map3D>((selected) => this.fire("select", { marker: selected }));
  readonly #light: MapLight;
  readonly #pointer = new PointerEvents(this);
  readonly #abort = new AbortController();
  #gestures: Gestures | undefined;
  #drawnCamera: Camera | undefined;
  #relief: VisibleDepths | undefined;
  #plans: readonly LayerPlan[] = [];
  /** @internal Estimates light that was not rendered. */
  lightEstimator: LightEstimator | null = null;
  /** Whether anything apart from the camera has changed since the last frame. */
  #dirty = true;
  /** Whether the view has not moved since the last "moveend". */
  #atRest = true;
  #loaded = false;
  /** Whether the last frame shows everything in view. */
  #complete = false;
  /** Whether the map has been at rest since it moved last, so that tiles of other views are fetched. */
  #fetchesAhead = false;
  #nameCount = 0;
  #lastError: Error | undefined;

  /** @param target the id of a canvas, or an element  @throws UsageError when there is none, when it has a map already, and for unknown or wrong options */
  constructor(target: string | HTMLElement, options: MapOptions = {}) {
    super();
    this.options = fillMapOptions(options);
    const withoutShadows = this.options.dataSaver ? { shadows: false, occlusion: false } : {};
    this.#light = new MapLight({ ...withoutShadows, ...options.light });
    adoptStyles(document, STYLES);
    this.#viewport = new Viewport(target, () => this.#onResize());
    if (options.background !== undefined) this.setBackground(options.background);
    this.#renderer = this.#createRenderer();
    this.#addListeners();
    addControls(this, this.options);
  }

  // Layers, markers and popups

  /** Adds a layer, marker or popup. */
  add(item: Addable<Map3D>): this {
    if (!this.#items.add(item)) return this;
    item.attachTo(this);
    return this.#redraw();
  }

  /** Removes a layer, marker or popup. */
  discard(item: Addable<Map3D>): this {
    if (!this.#items.delete(item)) return this;
    item.detachFrom(this);
    return this.#redraw();
  }

  /** The same as `add`. */
  addLayer(item: Addable<Map3D>): this {
    return this.add(item);
  }

  /** The same as `discard`. */
  removeLayer(item: Addable<Map3D>): this {
    return this.discard(item);
  }

  /** Removes the map; the canvas is left in the page as it was before. */
  remove(): this {
    this.#loop.stop();
    this.#abort.abort();
    this.#pointer.stop();
    for (const item of this.#items.all) this.discard(item);
    this.#renderer?.destroy();
    this.#viewport.destroy();
    return this.fire("remove", {});
  }

  /** The map's image layers, lowest first. */
  get layers(): readonly ImageLayer[] {
    return this.#items.layers;
  }

  /** Attribution texts of all layers. */
  get attributions(): readonly string[] {
    return this.#items.attributions;
  }

  /** @internal */
  get markers(): readonly Marker[] {
    return this.#items.markers;
  }

  /** The element that contains the canvas, markers, popups and controls. */
  get container(): HTMLElement {
    return this.#viewport.container;
  }

  /** The current canvas; a new one replaces it when WebGL is lost for good. */
  get canvas(): HTMLCanvasElement {
    return this.#viewport.canvas;
  }

  /** The current drawer: "webgl" or "canvas"; null when the browser supports neither. */
  get drawer(): "webgl" | "canvas" | null {
    return this.#renderer?.drawer.name ?? null;
  }

  /** @internal What the last frame shows of each layer. */
  get plans(): readonly LayerPlan[] {
    return this.#plans;
  }

  /** @internal Whether the picture is still that of the previous view. */
  get showsPreviousView(): boolean {
    return this.#renderer?.drawer.showsPreviousView === true;
  }

  /** @internal The element that shows the picture: the canvas, or an element below it; null when nothing can be drawn. */
  get drawerElement(): HTMLElement | null {
    return this.#renderer?.drawer.element ?? null;
  }

  get language(): string {
    return this.options.language ?? findLanguage(this.container);
  }

  get overlayPane(): HTMLElement {
    return this.#viewport.overlayPane;
  }

  /** @internal Contains the buttons. */
  get controlPane(): HTMLElement {
    return this.#viewport.controlPane;
  }

  // Light and background

  /** The current light. */
  get light(): Readonly<Light> {
    return this.#light.current;
  }

  /** Changes properties of the light; clamps numbers to their ranges. Setting azimuth or elevation ends the light of `setTime`. */
  setLight(light: Partial<Light>): this {
    this.#light.set(light);
    return this.#fireLight();
  }

  /** The time of the light; null when it was not set by `setTime`. */
  get time(): Date | null {
    return this.#light.time;
  }

  /** Sets the light to a time at the scene's position: the colours of the day, and shadows where the rendering has them. */
  setTime(time: Date): this {
    checkTime(time);
    return this.whenReady((_, rendering) => {
      this.#light.setTime(time, rendering);
      this.#fireLight();
    });
  }

  /** @internal Sets the estimator of light that was not rendered. */
  setLightEstimator(shade: LightEstimator | null): this {
    this.lightEstimator = shade;
    return this.#redraw();
  }

  /** Sets the background, any CSS background; same as the custom property --map3d-background. */
  setBackground(background: string): this {
    this.container.style.setProperty("--map3d-background", background);
    return this;
  }

  #fireLight(): this {
    return this.fire("lightchange", { light: this.light }).#redraw();
  }

  // Queries

  /** Picks the object under CSS pixels, exactly: fetches a tile of the deepest level. Approximate if that fails. */
  async pick(point: Vec2): Promise<Pick> {
    const viewState = this.getViewState();
    return viewState ? pick(this.layers, viewState, point) : EMPTY_PICK;
  }

  /** Lists the visible objects of all layers, topmost layer first and the largest of each layer first. Ignores occlusion between layers. @param hidden includes objects that styles hide */
  async objectsInView(hidden = false): Promise<readonly (VisibleObject & { readonly layer: ImageLayer })[]> {
    const viewState = this.getViewState();
    return viewState ? findAllVisibleObjects(this.layers, viewState, hidden) : [];
  }

  /** Picks from the tiles in memory; null when none covers the point. */
  pickLoaded(point: Vec2): Pick | null {
    const viewState = this.getViewState();
    return viewState && pickLoaded(this.layers, viewState, point);
  }

  /**
   * Finds the world coordinates of a position, once the map has a view: on the "ground" those of the highest surface that is visible in some direction, of an
   * object the top of its box. Fetches a few tiles or files. @throws UsageError when there is no such object, or the scene's position on earth is unknown; or why
   * no rendering could be loaded
   */
  async findPosition(position: AnyPosition): Promise<Vec3> {
    checkPosition(position, "findPosition");
    const rendering = await new Promise<Rendering>((ready, fail) => {
      this.whenReady((_, found) => ready(found)).#items.onLoadError(fail);
    });
    return findPosition(position, this.layers, this.getViewState() as ViewState, rendering);
  }

  /** Whether everything in view is drawn, and nothing moves. */
  loaded(): boolean {
    return this.#complete && this.camera === this.#drawnCamera && !this.moving;
  }

  isOccluded(world: Vec3): boolean {
    return this.visibleDepths?.isPositionOccluded(world) ?? false;
  }

  findSurfaceAt(point: Vec2): Vec3 | null {
    return this.visibleDepths?.positionAt(point) ?? null;
  }

  /** @internal Depths of the last picture, for items that need them; null before "ready". */
  get visibleDepths(): VisibleDepths | null {
    const viewState = this.getViewState();
    if (this.#relief?.camera !== viewState?.camera) this.#relief = undefined;
    this.#relief ??= viewState ? new VisibleDepths(this.layers, viewState) : undefined;
    return this.#relief ?? null;
  }

  /** @internal Fetches the depths of a rectangle (U and V) from the deepest level where it has at most `maxTiles` tiles. @param ids reads object ids as well */
  fetchDepths(viewState: ViewState, rect: Rect, maxTiles: number, ids = false): ReturnType<typeof VisibleDepths.fetch> {
    return VisibleDepths.fetch(this.layers, viewState, rect, maxTiles, ids);
  }

  /** Size of the decoded tiles in memory, bytes. */
  get cacheBytes(): number {
    return this.#renderer?.cacheBytes ?? 0;
  }

  // Called by gestures and layers

  /** @internal */
  tap(point: Vec2): void {
    this.#items.deselectMarkers();
    void this.#pointer.click(point);
  }

  /** @internal */
  hover(point: Vec2 | null): void {
    if (!this.listens("mousemove") && !this.layers.some((layer) => layer.hovers)) return;
    this.#pointer.hover(point);
    this.#loop.request();
  }

  /** @internal Adds a custom layer; `on` false: removes it. */
  toggleCustomLayer(layer: CustomLayer, on = true): this {
    this.#renderer?.customLayers[on ? "add" : "delete"](layer);
    return this.#redraw();
  }

  /** @internal undefined when the map cannot draw. */
  get layerContext(): LayerContext | undefined {
    const renderer = this.#renderer;
    return renderer === null
      ? undefined
      : {
          tileResources: renderer.tileResources,
          createName: () => `layer${String(this.#nameCount++)}`,
          dropTiles: (layer) => {
            renderer.dropTiles(`${layer}/`);
          },
          checkCompatible: (rendering) => this.checkCompatible(rendering),
          onManifest: (rendering) => {
            if (!this.camera) this.initializeView(rendering);
            this.#redraw();
          },
          requestFrame: () => this.#redraw(),
          report: (error) => this.report(error),
        };
  }

  protected get size(): Size {
    return this.#viewport.size;
  }

  protected requestFrame(): void {
    this.#loop.request();
  }

  protected findCenterSurface(viewState: ViewState): Vec3 | null {
    return pickLoaded(this.layers, viewState, this.screenCenter())?.position ?? null;
  }

  /** @internal */
  report(error: Error): void {
    if (error === this.#lastError) return;
    this.#lastError = error;
    this.#items.onLoadError();
    if (this.listens("error")) this.fire("error", { error });
    else console.warn(`map3d: ${error.message}`);
  }

  // Frames

  #frame(now: number): void {
    const wasInTransition = this.transitionCamera !== null;
    this.advanceCamera(now);
    this.#pointer.flush();
    try {
      if (this.#dirty || this.isTurning || this.camera !== this.#drawnCamera || wasInTransition || this.transitionCamera)
        this.#draw(wasInTransition || this.transitionCamera !== null);
      else this.#comeToRest();
    } catch (reason) {
      this.report(asError(reason));
    }
  }

  /** @param inTransition screen positions change even if the camera does not */
  #draw(inTransition: boolean): void {
    const viewState = this.getViewState();
    if (!viewState || !this.#renderer || this.size.width === 0) return;
    const [lastCamera, tilesChanged] = [this.#drawnCamera, this.#dirty];
    [this.#drawnCamera, this.#dirty, this.#relief] = [viewState.camera, false, undefined];
    const moving = lastCamera !== undefined && lastCamera !== viewState.camera;
    this.#fetchesAhead &&= !moving;
    const input = {
      ...this.#planInput,
      lightEstimator: this.lightEstimator,
      moving,
      next: this.nextCamera && { ...viewState, camera: this.nextCamera },
      ahead: this.#fetchesAhead ? this.listViewsAhead(viewState) : [],
    };
    const { plans, complete, next } = this.#renderer.render(
      viewState,
      input,
      this.transitionCamera &&
        ((scene) => {
          this.transition?.draw({ ...scene, camera: viewState.camera, tilesChanged });
        }),
    );
    [this.#plans, this.#complete] = [plans, complete];
    if (lastCamera !== viewState.camera || inTransition) this.#fireMove(lastCamera, viewState.camera);
    this.frameEvents.fire("draw", {});
    if (this.lightEstimator && moving) this.#redraw();
    if (this.moving || !this.#atRest || complete) this.#loop.request();
    if (complete) this.#fireLoad();
    if (next) this.continueTurn(next);
  }

  get #planInput(): PlanInput {
    return { layers: this.layers, light: this.light, requiredKinds: this.#items.listNeeds(this.options.hover && !this.options.dataSaver) };
  }

  protected isCovered(camera: Camera): boolean {
    const viewState = this.getViewState();
    return (
      viewState !== null &&
      this.#renderer?.plan({ ...viewState, camera }, this.#planInput).every(({ uncovered }) => uncovered === 0) === true
    );
  }

  #fireMove(lastCamera: Camera | undefined, { zoom }: Camera): void {
    this.#atRest = false;
    this.frameEvents.fire("move", {});
    this.fire("move", {});
    if (lastCamera?.zoom !== zoom) this.fire("zoom", { zoom });
  }

  #fireLoad(): void {
    if (this.#loaded) return;
    this.#loaded = true;
    this.fire("load", {});
  }

  /** Called when there is nothing left to draw. */
  #comeToRest(): void {
    if (this.moving) {
      this.#loop.request();
      return;
    }
    if (!this.#atRest) this.fire("moveend", {});
    this.#atRest = true;
    if (this.#renderer?.busy !== false || !this.#loaded) return;
    if (!this.#fetchesAhead && !this.options.dataSaver) {
      this.#fetchesAhead = this.#dirty = true;
      this.#loop.request();
    }
    this.fire("idle", {});
  }

  #redraw(): this {
    this.#dirty = true;
    this.#complete = false;
    // The first picture shows tiles as soon as they arrive. WebGL must not run ahead of the GPU.
    this.#loop.request(!this.#loaded && this.drawer === "canvas" && !document.hidden);
    return this;
  }

  #onResize(): void {
    const { width, height } = this.size;
    this.resizeCamera(this.size);
    this.fire("resize", { width, height });
    this.#redraw();
  }

  // Setup

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
        failed: (error) => this.report(error),
      });
    } catch (reason) {
      const error = asError(reason);
      this.container.append(element("p", "map3d-message", { role: "alert" }, error.message));
      queueMicrotask(() => this.report(error));
      return null;
    }
  }

  #addListeners(): void {
    const { signal } = this.#abort;
    this.#listenToGestures();
    signal.addEventListener("abort", () => this.#gestures?.destroy());
    listenToKeys(this, signal);
    window.addEventListener(
      "online",
      () => {
        for (const layer of this.layers) layer.tiles?.clearFailures();
        this.#redraw();
      },
      { signal },
    );
  }

  /** Listens to gestures on the current canvas. */
  #listenToGestures(): void {
    this.#gestures?.destroy();
    this.#gestures = new Gestures(this, this.canvas);
  }
}

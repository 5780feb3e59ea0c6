import { adoptStyles, element } from "../core/dom";
import { asError, UsageError } from "../core/errors";
import { Evented } from "../core/events";
import type { Attachable, Holder, Surface, SurfaceEvents } from "../core/surface";
import { add, clamp, mid, sub, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { depthAtHeight, localFromUvd, uvdFromLocal } from "../geo/axes";
import { cssPixelM, projectedBox, screenFromLocal, uvFromScreen, zoomedAt, zoomToFit, type Camera } from "../geo/camera";
import { DEFAULT_LIGHT, validLight, type Light } from "../geo/light";
import type { Rendering, View } from "../geo/manifest";
import { marker } from "../overlay/marker";
import { attributionLine } from "../ui/attribution";
import { controls } from "../ui/controls";
import { DebugTiles } from "../ui/debugTiles";
import { STYLES } from "../ui/styles";
import { neighbourView } from "./directions";
import { FrameLoop } from "./frameLoop";
import { Gestures, type Steered } from "./gestures";
import { imageLayer } from "./imageLayer";
import { listenToKeys } from "./keyboard";
import { limited, zoomLimits } from "./limits";
import { Motion } from "./motion";
import { DEFAULTS, type ClickEvent, type FilledOptions, type MapEvents, type MapOptions } from "./options";
import { Painter, type Painted } from "./painter";
import { NOTHING, pickExactly, pickLoaded, type Pick } from "./picker";
import type { Sight, Stage } from "./stage";
import { Viewport } from "./viewport";

const FLIGHT_MS = 700;
const STEP_MS = 220;

/** A map in a canvas of the page. World coordinates are those of the scene's CRS, in metres. */
export class map extends Evented<MapEvents> implements Surface, Holder<map>, Steered {
  readonly options: FilledOptions;
  /** Tells markers and popups that places on the screen have changed. */
  readonly moves = new Evented<SurfaceEvents>();
  readonly #viewport: Viewport;
  readonly #painter: Painter | null;
  readonly #loop = new FrameLoop((now) => { this.#frame(now); });
  readonly #motion = new Motion(() => { this.#loop.request(); });
  readonly #items = new Set<Attachable<map>>();
  readonly #ending = new AbortController();
  readonly #debug = new DebugTiles();
  #layers: imageLayer[] = [];
  #reference: Rendering | undefined;
  #camera: Camera | undefined;
  #drawnCamera: Camera | undefined;
  #light: Readonly<Light>;
  #pending: (() => void)[] = [];
  #dirty = true;
  #loaded = false;
  #clicks = 0;
  #names = 0;
  #hover: Vec2 | null = null;

  /** @param target the id of a canvas, or the element  @throws UsageError when there is none */
  constructor(target: string | HTMLElement, options: MapOptions = {}) {
    super();
    this.options = { ...DEFAULTS, ...options };
    this.#light = validLight({ ...DEFAULT_LIGHT, ...options.light });
    adoptStyles(document, STYLES);
    this.#viewport = new Viewport(target, () => { this.#resized(); });
    if (options.background !== undefined) this.container.style.setProperty("--map3d-background", options.background);
    this.#painter = this.#makePainter();
    this.#listen();
    if (this.options.controls) this.#viewport.controlPane.append(controls(this));
    if (this.options.attribution) this.#viewport.controlPane.append(attributionLine(this, () => this.#layers.map((layer) => layer.attribution)));
    this.#viewport.overlayPane.append(this.#debug.pane);
  }

  // Things on the map

  add(item: Attachable<map>): this {
    if (this.#items.has(item)) return this;
    this.#items.add(item);
    if (item instanceof imageLayer) this.#layers = [...this.#layers, item];
    if (item instanceof marker) item.on("select", this.#selected);
    item.onAdd(this);
    return this.#redraw();
  }

  /** Takes a layer, marker or popup off the map. */
  discard(item: Attachable<map>): this {
    if (!this.#items.delete(item)) return this;
    this.#layers = this.#layers.filter((layer) => layer !== item);
    if (item instanceof marker) item.off("select", this.#selected);
    item.onRemove(this);
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

  get layers(): readonly imageLayer[] {
    return this.#layers;
  }

  get container(): HTMLElement {
    return this.#viewport.container;
  }

  get canvas(): HTMLCanvasElement {
    return this.#viewport.canvas;
  }

  get overlayPane(): HTMLElement {
    return this.#viewport.overlayPane;
  }

  // Where the map looks

  /** The surface in the middle of the screen as far as it is known, else the ground there; null before "ready". */
  get center(): Vec3 | null {
    const sight = this.#sight();
    return sight && this.#pointInTheMiddle(sight);
  }

  /** At whole numbers a tile pixel of that level is one CSS pixel. */
  get zoom(): number {
    return this.#camera?.zoom ?? 0;
  }

  /** The view's id, e.g. "45-22.5". */
  get direction(): string {
    return this.#camera?.frame.id ?? this.options.direction ?? "";
  }

  /** Degrees counter-clockwise from north. */
  get lookAt_deg(): number {
    return this.#camera?.frame.lookAtDeg ?? 0;
  }

  /** All views of the first layer. */
  get directions(): readonly { id: string; lookAtDeg: number; pitchDeg: number }[] {
    return [...(this.#reference?.views.values() ?? [])].map(({ frame }) => frame);
  }

  get zoomLimits(): [number, number] {
    return this.#camera && this.#reference ? zoomLimits(this.#camera, this.#reference.json.box) : [0, 0];
  }

  /** Puts a world position in the middle, at once. */
  setView(position: Vec3, zoom?: number): this {
    return this.#go(() => this.#cameraAt(position, zoom), 0);
  }

  flyTo(position: Vec3, zoom?: number, { duration_ms = FLIGHT_MS }: { duration_ms?: number } = {}): this {
    return this.#go(() => this.#cameraAt(position, zoom), duration_ms);
  }

  /** Shows a box of world coordinates as large as it fits. */
  fitBounds(box: Box3, { padding_px = 24, duration_ms = 0, maxZoom = Infinity }: { padding_px?: number; duration_ms?: number; maxZoom?: number } = {}): this {
    return this.#go((camera, { json: { origin } }) => fitted(camera, [sub(box[0], origin), sub(box[1], origin)], padding_px, maxZoom), duration_ms);
  }

  setZoom(zoom: number): this {
    return this.#go((camera) => ({ ...camera, zoom }), 0);
  }

  zoomIn(): this {
    return this.zoomBy(1);
  }

  zoomOut(): this {
    return this.zoomBy(-1);
  }

  /** Zooms smoothly by levels about a point of the screen, its middle unless given. */
  zoomBy(delta: number, anchor: Vec2 = this.#middle()): this {
    const camera = this.#camera;
    if (!camera) return this;
    if (still()) this.#setCamera(zoomedAt(camera, clamp(camera.zoom + delta, ...this.zoomLimits), anchor));
    else this.#motion.zoomBy(camera, delta, anchor, this.zoomLimits);
    return this;
  }

  /** Zooms by a factor, at once. */
  pinch(factor: number, anchor: Vec2): this {
    const camera = this.#camera;
    if (camera) this.#setCamera(zoomedAt(camera, clamp(camera.zoom + Math.log2(factor), ...this.zoomLimits), anchor));
    return this;
  }

  /** Moves the picture by CSS pixels, at once. */
  panBy(dx: number, dy: number): this {
    const camera = this.#camera;
    if (!camera) return this;
    const px = cssPixelM(camera);
    return this.#setCamera({ ...camera, u: camera.u - dx * px, v: camera.v + dy * px });
  }

  /** Another view of the rendering; the point in the middle stays there, highlights and markers stay on their objects. @throws UsageError */
  setDirection(direction: string): this {
    return this.#whenReady((camera, rendering) => {
      const view = rendering.views.get(direction);
      if (!view) throw new UsageError(`view "${direction}" is none of ${[...rendering.views.keys()].join(", ")}`);
      if (view.frame !== camera.frame) this.#turn(view, camera, rendering);
    });
  }

  /** The next direction of the same pitch, +1 counter-clockwise. */
  rotate(step: number): this {
    return this.#whenReady((camera, rendering) => this.setDirection(neighbourView(rendering, camera.frame, step)));
  }

  /** CSS pixels of a world position; null before "ready". */
  project(world: Vec3): Vec2 | null {
    return this.#camera && this.#reference ? screenFromLocal(this.#camera, sub(world, this.#reference.json.origin)) : null;
  }

  /** World position on the ground (height of the content's lowest point) under CSS pixels; null in level views. */
  unproject(point: Vec2): Vec3 | null {
    return this.#camera && this.#reference ? groundAt(this.#camera, this.#reference, point) : null;
  }

  // Light

  get light(): Readonly<Light> {
    return this.#light;
  }

  setLight(light: Partial<Light>): this {
    this.#light = validLight({ ...this.#light, ...light });
    this.fire("lightchange", { light: this.#light });
    return this.#redraw();
  }

  /** Any CSS background. */
  setBackground(background: string): this {
    this.container.style.setProperty("--map3d-background", background);
    return this;
  }

  // Asking

  /** What lies under CSS pixels, exactly: the deepest level's tile is fetched. Approximate when that fails. */
  async pick(point: Vec2): Promise<Pick> {
    const sight = this.#sight();
    if (!sight) return NOTHING;
    try {
      return await pickExactly(this.#layers, sight, point);
    } catch (reason) {
      this.#report(asError(reason));
      return { ...(pickLoaded(this.#layers, sight, point) ?? NOTHING), approximate: true };
    }
  }

  /** What the tiles in memory tell of a point; null when they tell nothing. */
  pickLoaded(point: Vec2): Pick | null {
    const sight = this.#sight();
    return sight && pickLoaded(this.#layers, sight, point);
  }

  /** Outlines and names of the tiles that are shown. */
  debug(on = true): this {
    this.#debug.show(on);
    return this.#redraw();
  }

  /** Bytes of decoded tiles in memory. */
  get cacheBytes(): number {
    return this.#painter?.cacheBytes ?? 0;
  }

  // What gestures and layers call

  /** @internal */
  grab(): void {
    this.#motion.stop();
  }

  /** @internal */
  glide(velocity: Vec2): void {
    if (!still()) this.#motion.glide(velocity);
  }

  /** @internal */
  tap(point: Vec2): void {
    for (const item of this.#items) if (item instanceof marker) item.select(false);
    void this.#click(point);
  }

  /** @internal */
  hover(point: Vec2): void {
    if (!this.listens("mousemove")) return;
    this.#hover = point;
    this.#loop.request();
  }

  /** @internal */
  get stage(): Stage {
    const painter = this.#painter;
    if (!painter) throw new UsageError("this map cannot draw: see its error event");
    return {
      shared: painter.shared,
      nameLayer: () => `layer${String(this.#names++)}`,
      ready: (rendering) => { this.#ready(rendering); },
      request: () => { this.#redraw(); },
      report: (error) => { this.#report(error); },
    };
  }

  // Frames

  #frame(now: number): void {
    const camera = this.#camera;
    if (camera) this.#camera = this.#limited(this.#motion.step(now, camera));
    if (this.#camera !== this.#drawnCamera) this.#dirty = true;
    if (this.#hover) this.#fireHover(this.#hover);
    if (this.#dirty) this.#draw();
    else this.#settle();
  }

  #draw(): void {
    const sight = this.#sight();
    if (!sight || !this.#painter || this.#viewport.size.width === 0) return;
    this.#dirty = false;
    const { zoom } = sight.camera;
    const [moved, zoomed] = [this.#drawnCamera !== sight.camera, this.#drawnCamera?.zoom !== zoom];
    this.#drawnCamera = sight.camera;
    const painted = this.#painter.paint(sight, this.#layers, this.#light, this.options.hover);
    this.#debug.update(painted.plans, sight.dpr);
    if (moved) this.#moved();
    if (zoomed) this.fire("zoom", { zoom });
    this.#after(painted);
  }

  #moved(): void {
    this.moves.fire("move", {});
    this.fire("move", {});
    this.#resting = false;
  }

  #resting = true;

  #after({ complete }: Painted): void {
    if (this.#motion.moving || !this.#resting || complete) this.#loop.request();
    if (!complete || this.#loaded) return;
    this.#loaded = true;
    this.fire("load", {});
  }

  /** Nothing is left to draw. */
  #settle(): void {
    if (this.#motion.moving) {
      this.#loop.request();
      return;
    }
    if (!this.#resting) this.fire("moveend", {});
    this.#resting = true;
    if (!this.#painter?.busy && this.#loaded) this.fire("idle", {});
  }

  #redraw(): this {
    this.#dirty = true;
    this.#loop.request();
    return this;
  }

  #resized(): void {
    const { width, height } = this.#viewport.size;
    if (this.#camera) this.#camera = { ...this.#camera, width, height };
    this.fire("resize", { width, height });
    this.#redraw();
  }

  // The camera

  #sight(): Sight | null {
    const dpr = Math.min(this.#viewport.size.dpr, this.options.maxPixelRatio);
    return this.#camera && this.#reference ? { camera: this.#camera, origin: this.#reference.json.origin, dpr } : null;
  }

  #limited(camera: Camera): Camera {
    if (camera === this.#drawnCamera || !this.#reference) return camera;
    return limited(camera, this.#reference.json.box);
  }

  #setCamera(camera: Camera): this {
    this.#camera = this.#limited(camera);
    this.#loop.request();
    return this;
  }

  #middle(): Vec2 {
    return [this.#viewport.size.width / 2, this.#viewport.size.height / 2];
  }

  #whenReady(act: (camera: Camera, rendering: Rendering) => void): this {
    const run = (): void => {
      if (this.#camera && this.#reference) act(this.#camera, this.#reference);
    };
    if (this.#camera) run();
    else this.#pending.push(run);
    return this;
  }

  #go(to: (camera: Camera, rendering: Rendering) => Camera, duration_ms: number): this {
    return this.#whenReady((camera, rendering) => {
      const target = limited(to(camera, rendering), rendering.json.box);
      this.#motion.stop();
      if (duration_ms <= 0 || still()) this.#setCamera(target);
      else this.#motion.fly(camera, target, duration_ms);
    });
  }

  #cameraAt(position: Vec3, zoom = this.zoom): Camera {
    const [camera, rendering] = [this.#camera as Camera, this.#reference as Rendering];
    const [u, v] = uvdFromLocal(camera.frame.axes, sub(position, rendering.json.origin));
    return { ...camera, u, v, zoom };
  }

  /** The first layer's manifest gives the map its view. */
  #ready(rendering: Rendering): void {
    if (!this.#camera) this.#begin(rendering);
    this.#redraw();
  }

  #begin(rendering: Rendering): void {
    const { width, height } = this.#viewport.size;
    const { json, views } = rendering;
    const { direction, center, zoom } = this.options;
    const view = views.get(direction ?? "") ?? [...views.values()][0];
    if (!view) return;
    if (direction !== undefined && !views.has(direction)) this.#report(new UsageError(`view "${direction}" is none of ${[...views.keys()].join(", ")}`));
    this.#reference = rendering;
    const camera = fitted({ frame: view.frame, u: 0, v: 0, zoom: 0, width, height }, json.box, Math.min(width, height) * 0.04, json.zmax);
    this.#camera = camera;
    if (json.start) this.#camera = this.#cameraAt(add(json.origin, json.start.local));
    if (center) this.setView(center, zoom);
    else if (zoom !== undefined) this.setZoom(zoom);
    for (const act of this.#pending.splice(0)) act();
    this.fire("ready", {});
    this.fire("directionchange", { direction: this.direction });
  }

  #turn(view: View, camera: Camera, rendering: Rendering): void {
    const sight = this.#sight();
    const held = sight && this.#pointInTheMiddle(sight);
    this.#motion.stop();
    this.#camera = { ...camera, frame: view.frame };
    this.#setCamera(held ? this.#cameraAt(held) : fitted(this.#camera, rendering.json.box, 0, camera.zoom));
    this.fire("directionchange", { direction: view.id });
  }

  #pointInTheMiddle(sight: Sight): Vec3 | null {
    const middle = this.#middle();
    return pickLoaded(this.#layers, sight, middle)?.position ?? this.unproject(middle);
  }

  // Events

  #listen(): void {
    const { signal } = this.#ending;
    const gestures = new Gestures(this, this.canvas);
    signal.addEventListener("abort", () => { gestures.destroy(); });
    const smooth = (dx: number, dy: number): void => {
      this.#go((camera) => ({ ...camera, u: camera.u - dx * cssPixelM(camera), v: camera.v + dy * cssPixelM(camera) }), STEP_MS);
    };
    listenToKeys(this, smooth, signal);
    window.addEventListener("online", () => { this.#retry(); }, { signal });
  }

  #retry(): void {
    for (const layer of this.#layers) layer.store?.forgive();
    this.#redraw();
  }

  #makePainter(): Painter | null {
    try {
      return new Painter(this.#viewport, this.options, {
        lost: () => this.fire("contextlost", {}),
        restored: () => this.fire("contextrestored", {}).#redraw(),
      });
    } catch (reason) {
      const error = asError(reason);
      this.container.append(element("p", "map3d-message", { role: "alert" }, error.message));
      queueMicrotask(() => { this.#report(error); });
      return null;
    }
  }

  #report(error: Error): void {
    if (this.listens("error")) this.fire("error", { error });
    else console.warn(`map3d: ${error.message}`);
  }

  #selected = ({ marker: chosen }: { marker: marker }): void => {
    for (const item of this.#items) if (item instanceof marker && item !== chosen) item.select(false);
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
    if (number === this.#clicks) this.fire("click", event);
  }

  async #described(event: ClickEvent): Promise<ClickEvent> {
    try {
      const object = await event.layer?.object(event.id);
      return object ? { ...event, name: object.name, class: object.class, attributes: object.attributes } : event;
    } catch (reason) {
      this.#report(asError(reason));
      return event;
    }
  }
}

/** Does the user want no movement? */
const still = (): boolean => matchMedia("(prefers-reduced-motion: reduce)").matches;

/** The camera that shows a local box. */
function fitted(camera: Camera, box: Box3, padding: number, maxZoom: number): Camera {
  const [low, high] = projectedBox(camera.frame, box);
  const [u, v] = uvdFromLocal(camera.frame.axes, mid(box));
  return { ...camera, u, v, zoom: Math.min(zoomToFit(camera, high[0] - low[0], high[1] - low[1], padding), maxZoom) };
}

function groundAt(camera: Camera, { json }: Rendering, point: Vec2): Vec3 | null {
  const [u, v] = uvFromScreen(camera, point);
  const d = depthAtHeight(camera.frame.axes, v, json.box[0][2]);
  return d === null ? null : add(json.origin, localFromUvd(camera.frame.axes, [u, v, d]));
}

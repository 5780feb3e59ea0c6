import { asError, UsageError } from "../core/errors";
import { Evented } from "../core/events";
import { add, clamp, dot, mid, sub, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { depthAtHeight, localFromUvd, uvdFromLocal } from "../geo/axes";
import { cssPixelM, projectedBox, screenFromLocal, uvFromScreen, zoomedAt, zoomToFit, type Camera } from "../geo/camera";
import { localFromLonLat, lonLatFromLocal } from "../geo/geographic";
import type { Rendering, View } from "../geo/manifest";
import { findIncompatibility } from "./compatibility";
import { findNeighbourView, findTiltedView } from "./neighbourViews";
import { limitCamera, computeZoomLimits } from "./limits";
import { Motion } from "./motion";
import type { FilledOptions, MapEvents } from "./options";
import type { ViewState } from "./layerContext";
import type { ViewTransition } from "./viewTransition";
import type { Size } from "./viewport";

const FLIGHT_MS = 700;
const STEP_MS = 220;
/** Two fingers turned so far turn the view to the next direction. */
const ROTATION_STEP_RAD = (28 * Math.PI) / 180;

/** Of `fitBounds`. */
export interface FitOptions {
  /** Free room at each side. Default 24. */
  padding_px?: number;
  /** Default 0: at once. */
  duration_ms?: number;
  /** Default: the map's greatest. */
  maxZoom?: number;
}

/** Where a map looks: its camera, and all that moves it. Calls before the first manifest is here wait for it. */
export abstract class CameraController extends Evented<MapEvents> {
  abstract readonly options: FilledOptions;
  protected readonly motion = new Motion(() => { this.requestFrame(); });
  protected camera: Camera | undefined;
  /** The first layer's manifest; its origin is that of the camera. */
  protected reference: Rendering | undefined;
  /** Makes movements of changes of direction; null: they are cuts. */
  protected transition: ViewTransition | null = null;
  /** What is seen while a change of direction is a movement. */
  protected transitionCamera: Camera | null = null;
  #pending: (() => void)[] = [];
  /** Clockwise, since the last turn. */
  #rotation_rad = 0;

  protected abstract get size(): Size;
  protected abstract requestFrame(): void;
  protected abstract report(error: Error): void;
  /** World position of the surface in the middle as far as it is in memory. */
  protected abstract findCenterSurface(viewState: ViewState): Vec3 | null;

  /** The surface in the middle of the screen as far as it is known, else the ground there; null before "ready". */
  get center(): Vec3 | null {
    const viewState = this.getViewState();
    return viewState && (this.findCenterSurface(viewState) ?? this.unproject(this.screenCenter()));
  }

  /** At whole numbers a tile pixel of that level is one CSS pixel. */
  get zoom(): number {
    return this.camera?.zoom ?? 0;
  }

  /** Of the ground across the screen, a CSS pixel; 0 before "ready". */
  get metresPerPixel(): number {
    return this.camera ? cssPixelM(this.camera) : 0;
  }

  /** Least and greatest. */
  get zoomLimits(): [number, number] {
    return this.camera && this.reference ? computeZoomLimits(this.camera, this.reference.json.box) : [0, 0];
  }

  /** The view's id, e.g. "45-22.5". */
  get direction(): string {
    return this.camera?.frame.id ?? this.options.direction ?? "";
  }

  /** Degrees counter-clockwise from north. */
  get lookAt_deg(): number {
    return this.camera?.frame.lookAtDeg ?? 0;
  }

  /** All views of the first layer. */
  get directions(): readonly { id: string; lookAtDeg: number; pitchDeg: number }[] {
    return [...(this.reference?.views.values() ?? [])].map(({ frame }) => frame);
  }

  /** Puts a world position in the middle, at once. */
  setView(position: Vec3, zoom?: number): this {
    return this.#moveTo((camera, rendering) => centerCamera(camera, rendering, position, zoom), 0);
  }

  /** Brings a world position to the middle, smoothly unless the reader wants no movement. */
  flyTo(position: Vec3, zoom?: number, { duration_ms = FLIGHT_MS }: { duration_ms?: number } = {}): this {
    return this.#moveTo((camera, rendering) => centerCamera(camera, rendering, position, zoom), duration_ms);
  }

  /** Shows a box of world coordinates as large as it fits. */
  fitBounds([low, high]: Box3, { padding_px = 24, duration_ms = 0, maxZoom = Infinity }: FitOptions = {}): this {
    return this.#moveTo((camera, { json: { origin } }) => fitCamera(camera, [sub(low, origin), sub(high, origin)], padding_px, maxZoom), duration_ms);
  }

  /** At once, about the middle; brought into `zoomLimits`. */
  setZoom(zoom: number): this {
    return this.#moveTo((camera) => ({ ...camera, zoom }), 0);
  }

  /** One level nearer, smoothly. */
  zoomIn(): this {
    return this.zoomBy(1);
  }

  /** One level further, smoothly. */
  zoomOut(): this {
    return this.zoomBy(-1);
  }

  /** Zooms smoothly by levels about a point of the screen, its middle unless given. */
  zoomBy(delta: number, anchor: Vec2 = this.screenCenter()): this {
    const camera = this.camera;
    if (!camera) return this;
    if (prefersReducedMotion()) return this.setCamera(zoomedAt(camera, clamp(camera.zoom + delta, ...this.zoomLimits), anchor));
    this.motion.zoomBy(camera, delta, anchor, this.zoomLimits);
    return this;
  }

  /** Zooms by a factor about a point of the screen, at once. */
  pinch(factor: number, anchor: Vec2): this {
    const camera = this.camera;
    return camera ? this.setCamera(zoomedAt(camera, clamp(camera.zoom + Math.log2(factor), ...this.zoomLimits), anchor)) : this;
  }

  /** Moves the picture by CSS pixels: at once, or smoothly. */
  panBy(dx: number, dy: number, { smooth = false }: { smooth?: boolean } = {}): this {
    return this.camera ? this.#moveTo((camera) => panCamera(camera, dx, dy), smooth ? STEP_MS : 0, smooth) : this;
  }

  /** Another view of the rendering; the point in the middle stays there, highlights and markers stay on their objects. @throws UsageError */
  setDirection(direction: string): this {
    return this.whenReady((camera, rendering) => {
      const view = rendering.views.get(direction);
      if (!view) throw new UsageError(`view "${direction}" is none of ${[...rendering.views.keys()].join(", ")}`);
      if (view.frame !== camera.frame) this.#switchView(view, camera, rendering);
    });
  }

  /** The next direction of the same pitch, +1 counter-clockwise. */
  rotate(step: number): this {
    return this.whenReady((camera, rendering) => this.setDirection(findNeighbourView(rendering, camera.frame, step)));
  }

  /** The next pitch of the nearest direction, +1 steeper; nothing when there is none. */
  tilt(step: number): this {
    return this.whenReady((camera, rendering) => {
      const view = findTiltedView(rendering, camera.frame, step);
      if (view !== null) this.setDirection(view);
    });
  }

  /** CSS pixels of a world position; null before "ready". */
  project(world: Vec3): Vec2 | null {
    return this.camera && this.reference ? screenFromLocal(this.transitionCamera ?? this.camera, sub(world, this.reference.json.origin)) : null;
  }

  /** World position on the ground (height of the content's lowest point) under CSS pixels; null in level views. */
  unproject(point: Vec2): Vec3 | null {
    return this.camera && this.reference ? findGround(this.camera, this.reference, point) : null;
  }

  /** Longitude and latitude (WGS 84, degrees) of a world position; null before "ready", and where the scene's place on earth is not known. */
  lonLat(world: Vec3): Vec2 | null {
    const json = this.reference?.json;
    return json?.geographic ? lonLatFromLocal(json.geographic, sub(world, json.origin)) : null;
  }

  /** World x and y of a longitude and latitude; null as with lonLat. */
  fromLonLat(lonLat: Vec2): Vec2 | null {
    const json = this.reference?.json;
    if (!json?.geographic) return null;
    const [x, y] = localFromLonLat(json.geographic, lonLat);
    return [json.origin[0] + x, json.origin[1] + y];
  }

  /** @internal */
  setTransition(turner: ViewTransition | null): this {
    this.transition = turner;
    this.transitionCamera = null;
    this.requestFrame();
    return this;
  }

  /** @internal Turns the picture clockwise under a hand; to the next direction when it has been turned far enough, unless a turner follows the hand. */
  rotateBy(rad: number): void {
    if (this.transition?.rotateBy(rad)) return;
    this.#rotation_rad += rad;
    if (Math.abs(this.#rotation_rad) < ROTATION_STEP_RAD) return;
    this.rotate(Math.sign(this.#rotation_rad));
    this.#rotation_rad = 0;
  }

  /** @internal A change of direction is under way. */
  get inTransition(): boolean {
    return this.transitionCamera !== null;
  }

  /** @internal The turner shows something else now. */
  requestTransitionFrame(): void {
    this.requestFrame();
  }

  /** @internal The hand has left. */
  endGesture(): void {
    this.#rotation_rad = 0;
    this.transition?.endGesture();
  }

  /** @internal */
  startGesture(): void {
    this.motion.stop();
  }

  /** @internal */
  startInertia(velocity: Vec2): void {
    if (!prefersReducedMotion()) this.motion.startInertia(velocity);
  }

  /** @internal */
  getViewState(): ViewState | null {
    const { pixelRatio, maxPixelRatio, finer, dataSaver } = this.options;
    const dpr = pixelRatio ?? Math.min(this.size.dpr, maxPixelRatio);
    const spared = dataSaver && dpr >= 1.5 ? 1 : 0;
    return this.camera && this.reference ? { camera: this.camera, origin: this.reference.json.origin, dpr, finer: finer - spared } : null;
  }

  /** @internal As another map's camera, whose origin is given, without limits. */
  syncCamera(camera: Camera, origin: Vec3): this {
    const { width, height } = this.size;
    const shift = sub(origin, this.reference?.json.origin ?? origin);
    const { right, up } = camera.frame.axes;
    this.camera = { ...camera, width, height, u: camera.u + dot(right, shift), v: camera.v + dot(up, shift) };
    this.requestFrame();
    return this;
  }

  /** @internal The next manifest gives the map its view, as the first one did. */
  resetView(): void {
    this.motion.stop();
    this.camera = this.reference = undefined;
  }

  protected get moving(): boolean {
    return this.motion.moving || this.transitionCamera !== null;
  }

  protected screenCenter(): Vec2 {
    return [this.size.width / 2, this.size.height / 2];
  }

  protected setCamera(camera: Camera): this {
    this.camera = this.reference ? limitCamera(camera, this.reference.json.box) : camera;
    this.requestFrame();
    return this;
  }

  /** The camera for this moment of a movement. */
  protected advanceCamera(now_ms: number): void {
    const camera = this.camera;
    const next = camera && this.motion.step(now_ms, camera);
    if (next && next !== camera) this.camera = this.reference ? limitCamera(next, this.reference.json.box) : next;
    this.transitionCamera = (this.camera && this.transition?.step(now_ms, this.camera)) ?? null;
  }

  /** @throws UsageError when a manifest does not go with the first */
  protected checkCompatible(rendering: Rendering): void {
    const why = this.reference ? findIncompatibility(this.reference, rendering) : null;
    if (why !== null) throw new UsageError(`rendering "${rendering.json.name}" cannot be shown on this map: ${why}`);
  }

  /** The first manifest gives the map its view. */
  protected initializeView(rendering: Rendering): void {
    const { width, height } = this.size;
    const { json, views } = rendering;
    const { direction, center, zoom } = this.options;
    const view = views.get(direction ?? "") ?? [...views.values()][0];
    if (!view) return;
    if (direction !== undefined && !views.has(direction)) this.report(new UsageError(`view "${direction}" is none of ${[...views.keys()].join(", ")}`));
    this.reference = rendering;
    const whole = fitCamera({ frame: view.frame, u: 0, v: 0, zoom: 0, width, height }, json.box, Math.min(width, height) * 0.04, json.zmax);
    const start = center ?? (json.start && add(json.origin, json.start.local));
    this.setCamera(start ? centerCamera(whole, rendering, start, zoom) : { ...whole, zoom: zoom ?? whole.zoom });
    for (const act of this.#pending.splice(0)) this.#runPending(act);
    this.fire("ready", {});
    this.fire("directionchange", { direction: this.direction });
  }

  /** What was called before there was a manifest fails like what comes later, but has nobody to tell but the map. */
  #runPending(act: () => void): void {
    try {
      act();
    } catch (reason) {
      this.report(asError(reason));
    }
  }

  protected whenReady(act: (camera: Camera, rendering: Rendering) => void): this {
    const run = (): void => {
      if (this.camera && this.reference) act(this.camera, this.reference);
    };
    if (this.camera) run();
    else this.#pending.push(run);
    return this;
  }

  #moveTo(to: (camera: Camera, rendering: Rendering) => Camera, duration_ms: number, stops = true): this {
    return this.whenReady((camera, rendering) => {
      const target = limitCamera(to(camera, rendering), rendering.json.box);
      if (stops) this.motion.stop();
      if (duration_ms <= 0 || prefersReducedMotion()) this.setCamera(target);
      else this.motion.fly(camera, target, duration_ms);
    });
  }

  #switchView(view: View, camera: Camera, rendering: Rendering): void {
    const held = this.center;
    const turned = { ...camera, frame: view.frame };
    this.motion.stop();
    this.setCamera(held ? centerCamera(turned, rendering, held) : fitCamera(turned, rendering.json.box, 0, camera.zoom));
    this.transition?.start(camera, held ? sub(held, rendering.json.origin) : mid(rendering.json.box));
    this.fire("directionchange", { direction: view.id });
  }
}

/** Does the user want no movement? */
const prefersReducedMotion = (): boolean => matchMedia("(prefers-reduced-motion: reduce)").matches;

function centerCamera(camera: Camera, { json }: Rendering, position: Vec3, zoom = camera.zoom): Camera {
  const [u, v] = uvdFromLocal(camera.frame.axes, sub(position, json.origin));
  return { ...camera, u, v, zoom };
}

function panCamera(camera: Camera, dx: number, dy: number): Camera {
  const px = cssPixelM(camera);
  return { ...camera, u: camera.u - dx * px, v: camera.v + dy * px };
}

/** The camera that shows a local box. */
function fitCamera(camera: Camera, box: Box3, padding: number, maxZoom: number): Camera {
  const [low, high] = projectedBox(camera.frame, box);
  const [u, v] = uvdFromLocal(camera.frame.axes, mid(box));
  return { ...camera, u, v, zoom: Math.min(zoomToFit(camera, high[0] - low[0], high[1] - low[1], padding), maxZoom) };
}

function findGround(camera: Camera, { json }: Rendering, point: Vec2): Vec3 | null {
  const [u, v] = uvFromScreen(camera, point);
  const d = depthAtHeight(camera.frame.axes, v, json.box[0][2]);
  return d === null ? null : add(json.origin, localFromUvd(camera.frame.axes, [u, v, d]));
}

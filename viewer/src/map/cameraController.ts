import { checkNumber, checkVector } from "../core/check";
import { prefersReducedMotion } from "../core/dom";
import { asError, FetchError, UsageError } from "../core/errors";
import { Evented } from "../core/events";
import { checkPosition, isVector, type AnyPosition, type Position } from "../core/position";
import { clamp, dot, boxCenter, sub, type Vec2, type Vec3 } from "../core/vec";
import { cssPixelM, screenFromLocal, uvFromScreen, zoomedAt, type Camera } from "../geo/camera";
import type { Rendering, View } from "../geo/manifest";
import { lonLatFromWorld, worldFromLonLat, worldPosition } from "../geo/position";
import { findIncompatibility } from "./compatibility";
import { findNeighbourView, findTiltedView } from "./neighbourViews";
import { centerCamera, checkBounds, findGround, fitCamera, localBox, makeFirstCamera, panCamera, type Bounds } from "./cameras";
import { COARSE_STEPS, type LayerPlan } from "./layerPlan";
import { limitCamera, computeZoomLimits, panSoftly, type Limits } from "./limits";
import { Motion } from "./motion";
import { EVENTS, type FilledOptions, type FitOptions, type MapEvents } from "./options";
import type { ViewState } from "./layerContext";
import type { ViewTransition } from "./viewTransition";
import type { Size } from "./viewport";

const FLIGHT_MS = 700;
const STEP_MS = 220;
/** A rotation by two fingers that switches to the next direction. */
const ROTATION_STEP_RAD = (28 * Math.PI) / 180;

/** The map's camera and everything that moves it. Calls before the first manifest has loaded wait for it. */
export abstract class CameraController extends Evented<MapEvents> {
  abstract readonly options: FilledOptions;
  protected readonly motion = new Motion(
    () => this.requestFrame(),
    (camera) => this.#limit(camera),
  );
  protected camera: Camera | undefined;
  /** The first layer's rendering, whose origin the camera uses. */
  protected reference: Rendering | undefined;
  /** Animates changes of view; null: views switch at once. */
  protected transition: ViewTransition | null = null;
  /** The camera of a running view transition. */
  protected transitionCamera: Camera | null = null;
  /** The view that replaces the current one once its tiles cover the screen; null: none. */
  protected nextView: View | null = null;
  /** What the next view has at its centre; null: what the current one has. */
  #nextCenter: Vec3 | null = null;
  #pending: (() => void)[] = [];
  #limits: Limits | undefined;
  /** The first camera of a map whose element has had no size so far. */
  #unsized: Camera | undefined;
  /** Number of movements so far: a later one replaces one that waits for its position. */
  #moves = 0;
  /** Clockwise rotation since the last switch of views. */
  #rotation_rad = 0;

  protected abstract get size(): Size;
  protected abstract requestFrame(): void;
  /** @internal */
  abstract report(error: Error): void;
  /** Whether tiles in memory, of whatever level, cover what a camera shows. */
  protected abstract isCovered(camera: Camera): boolean;
  /** Finds the world coordinates of a position. */
  abstract findPosition(position: AnyPosition): Promise<Vec3>;
  /** Finds the world position of the surface at the screen's centre, if it is in memory. */
  protected abstract findCenterSurface(viewState: ViewState): Vec3 | null;

  protected override get eventTypes(): readonly (keyof MapEvents)[] {
    return EVENTS;
  }

  /** World position of the surface at the screen's centre if known, else of the ground there; null before "ready". */
  get center(): Vec3 | null {
    const viewState = this.getViewState();
    return viewState && (this.findCenterSurface(viewState) ?? this.unproject(this.screenCenter()));
  }

  /** Zoom level: at an integer, one tile pixel of that level is one CSS pixel. */
  get zoom(): number {
    return this.camera?.zoom ?? 0;
  }

  /** Metres per CSS pixel across the screen; 0 before "ready". */
  get metresPerPixel(): number {
    return this.camera ? cssPixelM(this.camera) : 0;
  }

  /** Minimum and maximum zoom. */
  get zoomLimits(): [number, number] {
    return this.camera && this.#limits ? computeZoomLimits(this.camera, this.#limits) : [0, 0];
  }

  /** Id of the current view, e.g. "45-22.5". */
  get direction(): string {
    return this.camera?.frame.id ?? this.options.direction ?? "";
  }

  /** Look-at angle, degrees counter-clockwise from north. */
  get lookAt_deg(): number {
    return this.camera?.frame.lookAt_deg ?? 0;
  }

  /** All views of the first layer. */
  get directions(): readonly { id: string; lookAt_deg: number; pitch_deg: number }[] {
    return [...(this.reference?.views.values() ?? [])].map(({ frame }) => frame);
  }

  /** Centres the map on a position, at once. @throws UsageError for anything but a position, and a number */
  setView(position: AnyPosition, zoom?: number): this {
    return this.#centerOn(position, zoom, 0);
  }

  /** Flies to a position; jumps there if the user prefers reduced motion. */
  flyTo(position: AnyPosition, zoom?: number, { duration_ms = FLIGHT_MS }: { duration_ms?: number } = {}): this {
    return this.#centerOn(position, zoom, duration_ms);
  }

  /** Moves smoothly to a position, at the same zoom. */
  panTo(position: AnyPosition, { duration_ms = STEP_MS }: { duration_ms?: number } = {}): this {
    return this.#centerOn(position, undefined, duration_ms);
  }

  /** Fits a box, given by two opposite corners, into the map. */
  fitBounds(bounds: Bounds, { padding_px = 24, duration_ms = 0, maxZoom = Infinity }: FitOptions = {}): this {
    checkBounds(bounds, "fitBounds");
    for (const number of [padding_px, maxZoom]) checkNumber(number, "fitBounds");
    return this.whenReady(() => this.#switchView()).#moveTo(
      (camera, rendering) => fitCamera(camera, localBox(bounds, rendering), padding_px, maxZoom),
      duration_ms,
    );
  }

  /** Sets the box that the map's centre stays in, by two opposite corners; null: the content's. */
  setMaxBounds(bounds: Bounds | null): this {
    if (bounds) checkBounds(bounds, "maxBounds");
    return this.whenReady((camera, rendering) => {
      if (this.#limits) this.#limits = { ...this.#limits, bounds: bounds ? localBox(bounds, rendering) : rendering.json.box };
      this.setCamera(camera);
    });
  }

  /** @internal Zooms to a rectangle of the screen, by two opposite corners. */
  zoomToRect([x0, y0]: Vec2, [x1, y1]: Vec2): void {
    this.#moveTo((camera) => {
      const [u, v] = uvFromScreen(camera, [(x0 + x1) / 2, (y0 + y1) / 2]);
      return {
        ...camera,
        u,
        v,
        zoom: camera.zoom + Math.log2(Math.min(camera.width / Math.abs(x1 - x0), camera.height / Math.abs(y1 - y0))),
      };
    }, FLIGHT_MS);
  }

  /** Sets the zoom at once, about the screen's centre and within `zoomLimits`. */
  setZoom(zoom: number): this {
    checkVector([zoom], "zoom", "a number", 1);
    return this.#moveTo((camera) => ({ ...camera, zoom }), 0);
  }

  /** Zooms in by one level, smoothly. */
  zoomIn(): this {
    return this.zoomBy(1);
  }

  /** Zooms out by one level, smoothly. */
  zoomOut(): this {
    return this.zoomBy(-1);
  }

  /** Zooms smoothly by levels about a point of the screen; default: its centre. */
  zoomBy(delta: number, anchor: Vec2 = this.screenCenter()): this {
    checkVector([delta, ...anchor], "zoomBy", "levels, and [x, y] in CSS pixels");
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

  /** Moves the picture by CSS pixels, at once or smoothly. */
  panBy(dx: number, dy: number, { smooth = false }: { smooth?: boolean } = {}): this {
    checkVector([dx, dy], "panBy", "two numbers of CSS pixels", 2);
    return this.camera ? this.#moveTo((camera) => panCamera(camera, dx, dy), smooth ? STEP_MS : 0, smooth) : this;
  }

  /**
   * Switches to another view of the rendering; keeps the point at the centre, or centres `center`. The current view stays until tiles of the other one cover
   * the screen, if only coarsely ("directionchange" tells when), or until a call sets the position; if they cannot be fetched, it remains and "error"
   * tells why. @param center world position  @throws UsageError for an unknown view
   */
  setDirection(direction: string, center: Vec3 | null = null): this {
    if (center) checkVector(center, "setDirection");
    return this.whenReady((camera, rendering) => {
      const view = rendering.views.get(direction);
      if (!view) throw new UsageError(`unknown view "${direction}"; the rendering has ${[...rendering.views.keys()].join(", ")}`);
      this.nextView = view.frame === camera.frame ? null : view;
      this.#nextCenter = center;
      if (this.nextCamera && (!this.isCovered(camera) || this.isCovered(this.nextCamera))) this.#switchView();
      this.requestFrame();
    });
  }

  /** Switches to the next direction of the same pitch, +1 counter-clockwise. */
  rotate(step: number): this {
    return this.whenReady((camera, rendering) => this.setDirection(findNeighbourView(rendering, (this.nextView ?? camera).frame, step)));
  }

  /** Switches to the next pitch in the nearest direction, +1 steeper; does nothing if there is none. */
  tilt(step: number): this {
    return this.whenReady((camera, rendering) => {
      const view = findTiltedView(rendering, (this.nextView ?? camera).frame, step);
      if (view !== null) this.setDirection(view);
    });
  }

  /** Projects a position to CSS pixels; null before "ready". "ground" is the height of the content's lowest point. */
  project(position: Position): Vec2 | null {
    checkPosition(position, "project");
    return this.camera && this.reference
      ? screenFromLocal(this.transitionCamera ?? this.camera, sub(worldPosition(position, this.reference), this.reference.json.origin))
      : null;
  }

  /** Returns the world position under CSS pixels on the ground (the height of the content's lowest point); null in level views. */
  unproject(point: Vec2): Vec3 | null {
    checkVector(point, "unproject", "[x, y] in CSS pixels", 2);
    return this.camera && this.reference ? findGround(this.camera, this.reference, point) : null;
  }

  /** Converts a world position to longitude and latitude (WGS 84, degrees); null before "ready", and where the scene's position on earth is unknown. */
  lonLat(world: Vec3): Vec2 | null {
    return this.reference ? lonLatFromWorld(this.reference.json, world) : null;
  }

  /** Converts longitude and latitude to world x and y; null as with lonLat. */
  fromLonLat(lonLat: Vec2): Vec2 | null {
    checkVector(lonLat, "fromLonLat", "[longitude, latitude] in degrees", 2);
    return this.reference ? worldFromLonLat(this.reference.json, lonLat) : null;
  }

  /** @internal */
  setTransition(transition: ViewTransition | null): this {
    this.transition = transition;
    this.transitionCamera = null;
    this.requestFrame();
    return this;
  }

  /** @internal Rotates the picture clockwise with the pointer: by the view transition, or to the next direction once it has been rotated far enough. */
  rotateBy(rad: number): void {
    if (this.transition?.rotateBy(rad)) return;
    this.#rotation_rad += rad;
    if (Math.abs(this.#rotation_rad) < ROTATION_STEP_RAD) return;
    this.rotate(Math.sign(this.#rotation_rad));
    this.#rotation_rad = 0;
  }

  /** @internal Whether a view transition is running. */
  get inTransition(): boolean {
    return this.transitionCamera !== null;
  }

  /** @internal Whether a view waits for its tiles. */
  get isTurning(): boolean {
    return this.nextView !== null;
  }

  /** @internal Requests a frame for a view transition. */
  requestTransitionFrame(): void {
    this.requestFrame();
  }

  /** @internal Moves the picture with a pointer: beyond the bounds with resistance. */
  dragBy(dx: number, dy: number): void {
    if (this.camera) this.camera = this.#panSoftly(this.camera, dx, dy);
    this.requestFrame();
  }

  /** @internal */
  endGesture(): void {
    this.#rotation_rad = 0;
    this.transition?.endGesture();
    this.startInertia([0, 0]);
  }

  /** @internal */
  startGesture(): void {
    this.#moves++;
    this.motion.stop();
  }

  /** @internal Continues a drag with inertia, and returns from beyond the bounds. */
  startInertia(velocity: Vec2): void {
    if (!prefersReducedMotion()) this.motion.startInertia(velocity, (camera, dx, dy) => this.#panSoftly(camera, dx, dy));
    else if (this.camera) this.setCamera(this.camera);
  }

  /** @internal */
  getViewState(): ViewState | null {
    const { pixelRatio, maxPixelRatio, maxTileRatio, finer, dataSaver } = this.options;
    const dpr = pixelRatio ?? Math.min(this.size.dpr, maxPixelRatio);
    const coarser = dataSaver && dpr >= 1.5 ? 1 : 0;
    return this.camera && this.reference
      ? {
          camera: this.camera,
          origin: this.reference.json.origin,
          dpr,
          finer: finer - coarser + Math.min(0, Math.log2(maxTileRatio / dpr)),
        }
      : null;
  }

  /** @internal Sets the camera to another map's, with its origin, without limits. */
  syncCamera(camera: Camera, origin: Vec3): this {
    const { width, height } = this.size;
    const shift = sub(origin, this.reference?.json.origin ?? origin);
    const { right, up } = camera.frame.axes;
    this.camera = { ...camera, width, height, u: camera.u + dot(right, shift), v: camera.v + dot(up, shift) };
    this.requestFrame();
    return this;
  }

  /** @internal Lets the next manifest set the view, as the first one did. */
  resetView(): void {
    this.motion.stop();
    this.nextView = null;
    this.camera = this.reference = undefined;
  }

  protected get moving(): boolean {
    return this.motion.moving || this.transitionCamera !== null;
  }

  protected screenCenter(): Vec2 {
    return [this.size.width / 2, this.size.height / 2];
  }

  protected setCamera(camera: Camera): this {
    this.camera = this.#limit(camera);
    this.requestFrame();
    return this;
  }

  #limit(camera: Camera): Camera {
    return this.#limits ? limitCamera(camera, this.#limits) : camera;
  }

  #panSoftly(camera: Camera, dx: number, dy: number): Camera {
    return this.#limits ? panSoftly(camera, dx, dy, this.#limits) : camera;
  }

  /** Advances animation and view transition to a time. */
  protected advanceCamera(now_ms: number): void {
    const camera = this.camera;
    const next = camera && this.motion.step(now_ms, camera);
    if (next && next !== camera) this.camera = next;
    this.transitionCamera = (this.camera && this.transition?.step(now_ms, this.camera)) ?? null;
  }

  /** @throws UsageError when a rendering cannot be combined with the first */
  protected checkCompatible(rendering: Rendering): void {
    const reason = this.reference ? findIncompatibility(this.reference, rendering) : null;
    if (reason !== null) throw new UsageError(`rendering "${rendering.json.name}" cannot be shown on this map: ${reason}`);
  }

  /** Sets the initial view from the first manifest. */
  protected initializeView(rendering: Rendering): void {
    const { json, views } = rendering;
    const { direction, center, zoom, minZoom, maxZoom, maxBounds } = this.options;
    const view = views.get(direction ?? json.start?.view ?? "") ?? [...views.values()][0];
    if (!view) return;
    if (direction !== undefined && !views.has(direction))
      this.report(new UsageError(`unknown view "${direction}"; the rendering has ${[...views.keys()].join(", ")}`));
    this.reference = rendering;
    this.#limits = { box: json.box, bounds: json.box, minZoom, maxZoom };
    this.setCamera(makeFirstCamera(rendering, view, this.size, this.options));
    this.#unsized = this.size.width * this.size.height > 0 ? undefined : this.camera;
    if (maxBounds) this.#pending.unshift(() => this.setMaxBounds(maxBounds));
    if (center && !isVector(center)) this.#pending.unshift(() => this.setView(center, zoom));
    for (const action of this.#pending.splice(0)) this.#runPending(action);
    this.fire("ready", {});
    this.fire("directionchange", { direction: this.direction });
  }

  /** Gives the camera the map's size. The first size sets what nothing else has set before: the zoom, and the position. */
  protected resizeCamera({ width, height }: Size): void {
    const { camera, reference } = this;
    if (!camera || (camera.width === width && camera.height === height)) return;
    const before = this.#unsized;
    let { u, v, zoom } = camera;
    if (before && width * height > 0) {
      this.#unsized = undefined;
      const first = makeFirstCamera(reference as Rendering, camera, { width, height }, this.options);
      if (u === before.u && v === before.v) ({ u, v } = first);
      if (zoom === before.zoom) ({ zoom } = first);
    }
    this.setCamera({ ...camera, width, height, u, v, zoom });
  }

  /** Runs a call that waited for the manifest; its errors are reported by the map. */
  #runPending(action: () => void): void {
    try {
      action();
    } catch (reason) {
      this.report(asError(reason));
    }
  }

  /** Calls a function once the map has a view: at once if it has one. */
  whenReady(action: (camera: Camera, rendering: Rendering) => void): this {
    const run = (): void => {
      if (this.camera && this.reference) action(this.camera, this.reference);
    };
    if (this.camera) run();
    else this.#pending.push(run);
    return this;
  }

  #centerOn(position: AnyPosition, zoom: number | undefined, duration_ms: number): this {
    checkPosition(position, "setView");
    checkNumber(zoom, "zoom");
    if (isVector(position))
      return this.whenReady(() => this.#switchView()).#moveTo(
        (camera, rendering) => centerCamera(camera, rendering, position, zoom),
        duration_ms,
      );
    const move = ++this.#moves;
    this.findPosition(position)
      .then((found) => {
        if (move === this.#moves) this.#centerOn(found, zoom, duration_ms);
      })
      .catch((reason: unknown) => this.report(asError(reason)));
    return this;
  }

  #moveTo(to: (camera: Camera, rendering: Rendering) => Camera, duration_ms: number, stops = true): this {
    this.#moves++;
    return this.whenReady((camera, rendering) => {
      const target = this.#limit(to(camera, rendering));
      if (stops) this.motion.stop();
      if (duration_ms <= 0 || prefersReducedMotion()) this.setCamera(target);
      else this.motion.fly(camera, target, duration_ms);
    });
  }

  /** The camera of the view that waits for its tiles; null: none waits. */
  protected get nextCamera(): Camera | null {
    return this.nextView && this.camera ? this.#turn(this.nextView, this.camera) : null;
  }

  /** Shows the view that waits as soon as its tiles cover the screen, or keeps the current one when most of them are unavailable. */
  protected continueTurn(plans: readonly LayerPlan[]): void {
    const unavailable = plans.every(({ complete }) => complete);
    if (plans.every(({ uncovered, cover }) => uncovered <= (unavailable ? cover.length / 2 : 0))) this.#switchView();
    else if (unavailable) {
      this.report(new FetchError(`view "${this.nextView?.id ?? ""}" cannot be shown: its tiles are not available`));
      this.nextView = null;
    }
  }

  /** Lists the views that the next turn may show, as coarse as its first picture; none if the user saves data. */
  protected listViewsAhead(viewState: ViewState): ViewState[] {
    const { camera, reference } = this;
    if (!camera || !reference || this.options.dataSaver) return [];
    const views = [1, -1].map((step) => reference.views.get(findNeighbourView(reference, camera.frame, step)) as View);
    return [...new Set(views)]
      .filter(({ frame }) => frame !== camera.frame)
      .map((view) => ({ ...viewState, finer: viewState.finer - COARSE_STEPS, camera: this.#turn(view, camera) }));
  }

  /** Computes the camera of another view with the same place at the centre. */
  #turn({ frame }: View, camera: Camera): Camera {
    const { reference } = this;
    const center = (this.nextView ? this.#nextCenter : null) ?? this.center;
    const [target, rendering] = [{ ...camera, frame }, reference as Rendering];
    return this.#limit(center ? centerCamera(target, rendering, center) : fitCamera(target, rendering.json.box, 0, camera.zoom));
  }

  /** Shows the view that waits for its tiles, if one does. */
  #switchView(): void {
    const { nextView, nextCamera, camera, reference } = this;
    if (!nextView || !nextCamera || !camera || !reference) return;
    const center = this.#nextCenter ?? this.center;
    this.nextView = null;
    this.motion.stop();
    this.setCamera(nextCamera);
    this.transition?.start(camera, center ? sub(center, reference.json.origin) : boxCenter(reference.json.box));
    this.fire("directionchange", { direction: nextView.id });
  }
}

import { prefersReducedMotion } from "../core/dom";
import { clamp, type Vec2, type Vec3 } from "../core/vec";
import { computeAxes, uvdFromLocal } from "../geo/axes";
import type { Camera } from "../geo/camera";
import type { Frame } from "../geo/frame";
import { MapLayer, type TransitionFrame, type Map3D, type ViewTransition } from "../map3d";
import { fadeOut } from "./fade";
import { Warp, type RgbdImage } from "./warp";

/** Options of `orbit`. */
export interface OrbitOptions {
  /** Duration of a rotation by 90°; others are scaled. Default 750. */
  duration_ms?: number;
}

/** Degrees. */
interface ViewAngles {
  readonly lookAt: number;
  readonly pitch: number;
}

/** A transition in progress. */
interface TransitionState {
  /** Camera of the previous view. */
  readonly from: Camera;
  readonly pivot: Vec3;
  /** Angles and time at the start; the time is set with the first frame. */
  readonly start: ViewAngles;
  start_ms: number | null;
  /** Angles of the current frame. */
  current: ViewAngles;
  /** All tiles of the new view are loaded. */
  complete: boolean;
  ended_ms: number | null;
  images: [RgbdImage, RgbdImage] | null;
}

/** A rotation gesture: angle at its start, and rotation since. */
interface RotateGesture {
  readonly base_deg: number;
  turned_deg: number;
}

const FADE_MS = 300;
/** Extra size of the images, for tall buildings. */
const MARGIN_FACTOR = 1.1;
/** Maximum number of pixels of an image, and of the result. */
const MAX_PX = 1.4e6;
/** Longest wait at the end of a transition for tiles that are still loading. */
const MAX_WAIT_MS = 2500;
/** A gesture must exceed this angle to change the view. */
const MIN_GESTURE_DEG = 3;

const anglesOf = ({ lookAt_deg, pitch_deg }: Frame): ViewAngles => ({ lookAt: lookAt_deg, pitch: pitch_deg });
/** Signed difference of two angles, −180 to 180. */
const angleBetween = (from: number, to: number): number => ((((to - from + 180) % 360) + 360) % 360) - 180;
const angularDistance = (a: ViewAngles, b: ViewAngles): number => Math.hypot(angleBetween(a.lookAt, b.lookAt), a.pitch - b.pitch);

/**
 * Animates changes of the view. Warps the images of both views by their depth and blends them, so that each fills the gaps of the other. Two fingers or the
 * right mouse button rotate freely between views; on release, the map moves to the nearest view. Without WebGL the views cross-fade; under
 * `prefers-reduced-motion` they switch at once. Reads depth tiles.
 */
export class Orbit extends MapLayer<Map3D, object> implements ViewTransition {
  /** The 2D canvas cross-fades without depth. */
  get needs(): readonly "depth"[] {
    return this.map?.drawer === "webgl" ? ["depth"] : [];
  }

  readonly #duration_ms: number;
  #warp: Warp | undefined;
  #transition: TransitionState | null = null;
  #gesture: RotateGesture | null = null;

  constructor({ duration_ms = 750 }: OrbitOptions = {}) {
    super();
    this.#duration_ms = duration_ms;
  }

  protected onAdd(map: Map3D): void {
    map.setTransition(this);
  }

  protected onRemove(map: Map3D): void {
    this.#finish();
    map.setTransition(null);
  }

  /** @internal */
  start(from: Camera, pivot: Vec3): void {
    const { map } = this;
    if (prefersReducedMotion() || !map?.drawer) return;
    if (map.drawer === "canvas") {
      if (map.drawerElement) fadeOut(map.drawerElement, FADE_MS, () => map.showsPreviousView);
      return;
    }
    const start = this.#transition?.current ?? anglesOf(from.frame);
    this.#free();
    this.#transition = { from, pivot, start, start_ms: null, current: start, complete: false, ended_ms: null, images: null };
  }

  /** @internal */
  rotateBy(rad: number): boolean {
    const map = this.map;
    if (!map || map.drawer !== "webgl" || prefersReducedMotion()) return false;
    this.#gesture ??= { base_deg: this.#transition?.current.lookAt ?? map.lookAt_deg, turned_deg: 0 };
    this.#gesture.turned_deg += (rad * 180) / Math.PI;
    const lookAt = this.#gesture.base_deg + this.#gesture.turned_deg;
    const beyond = angleBetween(map.lookAt_deg, lookAt);
    const back = this.#transition ? angleBetween(map.lookAt_deg, this.#transition.from.frame.lookAt_deg) : 0;
    const between = this.#transition && Math.sign(beyond) === Math.sign(back) && Math.abs(beyond) <= Math.abs(back);
    if (!between && !map.isTurning && Math.abs(beyond) > MIN_GESTURE_DEG) map.rotate(Math.sign(beyond));
    if (this.#transition) this.#transition.current = { ...this.#transition.current, lookAt };
    map.requestTransitionFrame();
    return true;
  }

  /** @internal */
  endGesture(): void {
    const [transition, map] = [this.#transition, this.map];
    if (!this.#gesture || !map) return;
    this.#gesture = null;
    if (!transition) return;
    const to = map.lookAt_deg;
    if (
      Math.abs(angleBetween(transition.current.lookAt, transition.from.frame.lookAt_deg)) <
      Math.abs(angleBetween(transition.current.lookAt, to))
    )
      map.setDirection(transition.from.frame.id);
    else this.#transition = { ...transition, start: transition.current, start_ms: performance.now() };
  }

  /** @internal */
  step(now_ms: number, camera: Camera): Camera | null {
    const transition = this.#transition;
    if (!transition) return null;
    const target = anglesOf(camera.frame);
    if (!this.#gesture) {
      const angle_deg = angularDistance(transition.start, target);
      const duration_ms = clamp(this.#duration_ms * (0.35 + (0.65 * angle_deg) / 90), 1, 2 * this.#duration_ms);
      const share = clamp((now_ms - (transition.start_ms ?? now_ms)) / duration_ms, 0, 1);
      const eased = share * share * (3 - 2 * share);
      transition.current = {
        lookAt: transition.start.lookAt + angleBetween(transition.start.lookAt, target.lookAt) * eased,
        pitch: transition.start.pitch + (target.pitch - transition.start.pitch) * eased,
      };
      if (share === 1) transition.ended_ms ??= now_ms;
    }
    if (transition.ended_ms !== null && (transition.complete || now_ms - transition.ended_ms > MAX_WAIT_MS)) {
      this.#finish();
      return null;
    }
    return intermediateCamera(camera, transition);
  }

  /** @internal */
  draw(frame: TransitionFrame): void {
    const transition = this.#transition;
    const { gl, camera } = frame;
    if (!transition || gl.isContextLost()) return;
    if (this.#warp?.gl !== gl) this.#free();
    const warp = (this.#warp ??= this.#createWarp(gl));
    transition.complete = frame.complete;
    transition.images ??= [
      renderRgbd(frame, warp, transition.from, camera.frame, null),
      renderRgbd(frame, warp, camera, transition.from.frame, null),
    ];
    const second = transition.images[1];
    if (frame.tilesChanged || hasMoved(second.source, camera))
      transition.images[1] = renderRgbd(frame, warp, camera, transition.from.frame, second);
    const intermediate = intermediateCamera(camera, transition);
    const [a, b] = [
      angularDistance(transition.current, anglesOf(transition.from.frame)),
      angularDistance(transition.current, anglesOf(camera.frame)),
    ];
    const share = a + b > 0 ? a / (a + b) : 1;
    const size = limitSize(frame.width, frame.height);
    transition.start_ms ??= performance.now();
    warp.draw(
      transition.images,
      { camera: intermediate, pivot: transition.pivot, range: frame.getDepthRange(intermediate.frame) },
      share * share * (3 - 2 * share),
      frame,
      size,
    );
  }

  /** @throws DrawError; the view then changes at once */
  #createWarp(gl: WebGL2RenderingContext): Warp {
    try {
      return new Warp(gl);
    } catch (reason) {
      this.#finish();
      throw reason;
    }
  }

  #finish(): void {
    this.#transition = null;
    this.#free();
  }

  #free(): void {
    this.#warp?.free();
    this.#warp = undefined;
    if (this.#transition) this.#transition.images = null;
  }
}

/** The map's camera at the current angles; the pivot keeps its position on the screen. */
function intermediateCamera(camera: Camera, { current, pivot }: Pick<TransitionState, "current" | "pivot">): Camera {
  const axes = computeAxes(current.lookAt, current.pitch);
  const [u, v] = uvdFromLocal(camera.frame.axes, pivot);
  const [turnedU, turnedV] = uvdFromLocal(axes, pivot);
  return {
    ...camera,
    frame: { ...camera.frame, axes, lookAt_deg: current.lookAt, pitch_deg: current.pitch },
    u: turnedU + camera.u - u,
    v: turnedV + camera.v - v,
  };
}

const hasMoved = (a: Camera, b: Camera): boolean =>
  (["u", "v", "zoom", "frame", "width", "height"] as const).some((part) => a[part] !== b[part]);

/** Renders what a camera sees, enlarged to what becomes visible half-way to another frame. @param into image whose target is reused */
function renderRgbd(frame: TransitionFrame, warp: Warp, camera: Camera, other: Frame, into: RgbdImage | null): RgbdImage {
  const [wide, high] = sweptSize(camera, other);
  const [width, height] = limitSize(wide * (frame.width / camera.width), high * (frame.height / camera.height));
  const larger = { ...camera, width, height, zoom: camera.zoom - Math.log2(wide / width) };
  const range = frame.getDepthRange(camera.frame);
  const target = into?.target.width === width && into.target.height === height ? into.target : warp.createTarget(width, height);
  frame.drawView(larger, range, target.framebuffer);
  return { source: camera, camera: larger, range, target };
}

/** Size, CSS pixels, of the level ground that the screen has covered half-way to another frame. */
function sweptSize({ frame, width, height }: Camera, other: Frame): Vec2 {
  const half = (Math.abs(angleBetween(frame.lookAt_deg, other.lookAt_deg)) / 2) * (Math.PI / 180);
  const flat = Math.max(0.3, Math.sin((frame.pitch_deg * Math.PI) / 180));
  const [along, across] = [Math.abs(Math.cos(half)), Math.abs(Math.sin(half))];
  return [
    MARGIN_FACTOR * Math.max(width, width * along + (height * across) / flat),
    MARGIN_FACTOR * Math.max(height, height * along + width * across * flat),
  ];
}

/** Limits a size to `MAX_PX` pixels; keeps the aspect ratio. */
function limitSize(width: number, height: number): Vec2 {
  const scale = Math.min(1, Math.sqrt(MAX_PX / (width * height)));
  return [Math.max(2, Math.round(width * scale)), Math.max(2, Math.round(height * scale))];
}

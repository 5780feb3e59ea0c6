import { clamp, type Vec2 } from "../core/vec";
import { cssPixelM, zoomedAt, type Camera } from "../geo/camera";

/** Computes the camera at a time; null when the animation has ended. */
type CameraAnimation = (now_ms: number, camera: Camera) => Camera | null;

const FRICTION_MS = 260;
const WHEEL_MS = 70;
/** Beyond the bounds, movements slow down and return at this pace. */
const SPRING_MS = 80;

/** Animates the camera: flights, wheel zoom, inertia. A new animation replaces the current one. */
export class Motion {
  #animation: CameraAnimation | null = null;
  #wheel: { zoom: number; anchor: Vec2 } | null = null;
  readonly #changed: () => void;

  readonly #limit: (camera: Camera) => Camera;

  /** @param changed called when frames are needed  @param limit keeps a camera within the map's limits */
  constructor(changed: () => void, limit: (camera: Camera) => Camera) {
    [this.#changed, this.#limit] = [changed, limit];
  }

  get moving(): boolean {
    return this.#animation !== null;
  }

  stop(): void {
    this.#animation = null;
    this.#wheel = null;
  }

  /** Computes the camera at a time. */
  step(now_ms: number, camera: Camera): Camera {
    const next = this.#animation?.(now_ms, camera);
    if (this.#animation && !next) this.stop();
    return next ?? camera;
  }

  /** Flies straight to another camera of the same view, slowing at both ends; a common fixed point stays fixed. */
  fly(from: Camera, to: Camera, duration_ms: number): void {
    const zoomDelta = to.zoom - from.zoom;
    this.#runTimed((share, camera) => {
      const t = share * share * (3 - 2 * share);
      const progress = Math.abs(zoomDelta) < 1e-6 ? t : (1 - 2 ** (-zoomDelta * t)) / (1 - 2 ** -zoomDelta);
      return { ...camera, u: from.u + (to.u - from.u) * progress, v: from.v + (to.v - from.v) * progress, zoom: from.zoom + zoomDelta * t };
    }, duration_ms);
  }

  /** Zooms by `delta` levels about a point of the screen; successive calls add up. */
  zoomBy(camera: Camera, delta: number, anchor: Vec2, limits: readonly [number, number]): void {
    const zoom = clamp((this.#wheel?.zoom ?? camera.zoom) + delta, ...limits);
    this.#wheel = { zoom, anchor };
    let last = performance.now();
    this.#run((now, at) => {
      const share = 1 - Math.exp(-Math.max(now - last, 4) / WHEEL_MS);
      last = now;
      const remaining = zoom - at.zoom;
      if (Math.abs(remaining) < 0.002) return at.zoom === zoom ? null : this.#limit(zoomedAt(at, zoom, anchor));
      return this.#limit(zoomedAt(at, at.zoom + remaining * share, anchor));
    });
  }

  /** Continues a drag with inertia, and returns from beyond the bounds. Velocity in CSS pixels per millisecond. @param pan moves a camera by CSS pixels */
  startInertia(velocity: Vec2, pan: (camera: Camera, dx: number, dy: number) => Camera): void {
    let last = performance.now();
    let [vx, vy] = velocity;
    this.#run((now, camera) => {
      const dt = Math.min(Math.max(now - last, 1), 64);
      last = now;
      const next = pan(camera, vx * dt, vy * dt);
      const inside = this.#limit(next);
      const back = Math.exp(-dt / SPRING_MS);
      const [du, dv] = [next.u - inside.u, next.v - inside.v];
      const isOutside = Math.hypot(du, dv) > cssPixelM(camera) / 2;
      const decay = isOutside ? back : Math.exp(-dt / FRICTION_MS);
      [vx, vy] = Math.hypot(vx, vy) < 0.02 ? [0, 0] : [vx * decay, vy * decay];
      if (isOutside) return { ...next, u: inside.u + du * back, v: inside.v + dv * back };
      return inside.u === camera.u && inside.v === camera.v ? null : inside;
    });
  }

  #runTimed(at: (share: number, camera: Camera) => Camera, duration_ms: number): void {
    const start = performance.now();
    let ended = false;
    this.#run((now, camera) => {
      if (ended) return null;
      const share = clamp((now - start) / Math.max(duration_ms, 1), 0, 1);
      ended = share >= 1;
      return at(share, camera);
    });
    this.#wheel = null;
  }

  #run(animation: CameraAnimation): void {
    this.#animation = animation;
    this.#changed();
  }
}

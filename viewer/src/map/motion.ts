import { clamp, type Vec2 } from "../core/vec";
import { cssPixelM, zoomedAt, type Camera } from "../geo/camera";

/** Computes the camera at a time; null when the animation has ended. */
type CameraAnimation = (now_ms: number, camera: Camera) => Camera | null;

const FRICTION_MS = 260;
const WHEEL_MS = 70;

/** Animates the camera: flights, wheel zoom, inertia. A new animation replaces the current one. */
export class Motion {
  #animation: CameraAnimation | null = null;
  #wheel: { zoom: number; anchor: Vec2 } | null = null;
  readonly #changed: () => void;

  /** @param changed called when frames are needed */
  constructor(changed: () => void) {
    this.#changed = changed;
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
      if (Math.abs(remaining) < 0.002) return at.zoom === zoom ? null : zoomedAt(at, zoom, anchor);
      return zoomedAt(at, at.zoom + remaining * share, anchor);
    });
  }

  /** Continues a drag with inertia. Velocity in CSS pixels per millisecond. */
  startInertia(velocity: Vec2): void {
    let last = performance.now();
    let [vx, vy] = velocity;
    this.#run((now, camera) => {
      const dt = Math.min(Math.max(now - last, 1), 64);
      last = now;
      const px = cssPixelM(camera);
      const next = { ...camera, u: camera.u - vx * dt * px, v: camera.v + vy * dt * px };
      const decay = Math.exp(-dt / FRICTION_MS);
      [vx, vy] = [vx * decay, vy * decay];
      return Math.hypot(vx, vy) < 0.02 ? null : next;
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

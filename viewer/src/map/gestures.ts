import type { Vec2 } from "../core/vec";

/** What gestures do to a map. Screen positions in CSS pixels from the container's top left corner. */
export interface GestureTarget {
  readonly container: HTMLElement;
  /** A hand is on the map: movements stop. */
  startGesture(): void;
  panBy(dx: number, dy: number): unknown;
  startInertia(velocity: Vec2): void;
  /** At once, without smoothing. */
  pinch(factor: number, anchor: Vec2): unknown;
  zoomBy(delta: number, anchor: Vec2): unknown;
  /** Turns the picture clockwise. */
  rotateBy(rad: number): void;
  /** No hand is on the map any more. */
  endGesture(): void;
  tap(at: Vec2): void;
  hover(at: Vec2): void;
}

interface Pointer {
  at: Vec2;
  readonly start: Vec2;
}

const TAP_PX = 6;
const DOUBLE_TAP_MS = 320;
const DOUBLE_TAP_PX = 28;
const VELOCITY_MS = 90;
/** A drag with the right button turns the picture by so much a pixel. */
const ROTATION_RAD_PER_PX = (0.4 * Math.PI) / 180;

/** Mouse, touch and pen on the canvas: drag, pinch, wheel, tap, double tap. */
export class Gestures {
  readonly #map: GestureTarget;
  readonly #canvas: HTMLCanvasElement;
  readonly #pointers = new Map<number, Pointer>();
  readonly #listeners = new AbortController();
  #recentPoints: { at: Vec2; ms: number }[] = [];
  #moved = false;
  /** Where the right button was last, while it is down. */
  #rotatingFrom: Vec2 | null = null;
  #lastTap: { at: Vec2; ms: number } | null = null;

  constructor(map: GestureTarget, canvas: HTMLCanvasElement) {
    this.#map = map;
    this.#canvas = canvas;
    const { signal } = this.#listeners;
    canvas.addEventListener("pointerdown", (event) => { this.#down(event); }, { signal });
    canvas.addEventListener("pointermove", (event) => { this.#move(event); }, { signal });
    canvas.addEventListener("pointerup", (event) => { this.#up(event, true); }, { signal });
    canvas.addEventListener("pointercancel", (event) => { this.#up(event, false); }, { signal });
    canvas.addEventListener("contextmenu", (event) => { event.preventDefault(); }, { signal });
    canvas.addEventListener("wheel", (event) => { this.#wheel(event); }, { signal, passive: false });
  }

  destroy(): void {
    this.#listeners.abort();
  }

  #toScreen(event: MouseEvent): Vec2 {
    const box = this.#canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  #down(event: PointerEvent): void {
    const at = this.#toScreen(event);
    if (event.pointerType === "mouse" && event.button === 2) this.#rotatingFrom = at;
    else if (event.pointerType === "mouse" && event.button !== 0) return;
    this.#canvas.setPointerCapture(event.pointerId);
    if (this.#rotatingFrom) return;
    this.#map.startGesture();
    if (this.#pointers.size === 0) this.#moved = false;
    else this.#moved = true;
    this.#pointers.set(event.pointerId, { at, start: at });
    this.#recentPoints = [];
  }

  #move(event: PointerEvent): void {
    const touch = this.#pointers.get(event.pointerId);
    const at = this.#toScreen(event);
    if (this.#rotatingFrom) {
      this.#map.rotateBy((at[0] - this.#rotatingFrom[0]) * ROTATION_RAD_PER_PX);
      this.#rotatingFrom = at;
      return;
    }
    if (!touch) {
      if (event.pointerType === "mouse") this.#map.hover(at);
      return;
    }
    if (!this.#moved && Math.hypot(at[0] - touch.start[0], at[1] - touch.start[1]) < TAP_PX) return;
    this.#moved = true;
    this.#map.container.classList.add("map3d-dragging");
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) this.#pinch(touch, other, at);
    else this.#drag(touch, at, event);
    touch.at = at;
  }

  #drag(touch: Pointer, at: Vec2, event: PointerEvent): void {
    this.#map.panBy(at[0] - touch.at[0], at[1] - touch.at[1]);
    // Where frames are slow, one event stands for several: the hand's speed is known from them all, and from when they were, not when they are told.
    const all = "getCoalescedEvents" in event ? event.getCoalescedEvents() : [];
    const points = (all.length > 0 ? all : [event]).map((each) => ({ at: this.#toScreen(each), ms: each.timeStamp }));
    this.#recentPoints = [...this.#recentPoints, ...points].filter(({ ms }) => event.timeStamp - ms < VELOCITY_MS);
  }

  #pinch(touch: Pointer, other: Pointer, at: Vec2): void {
    const before = Math.hypot(touch.at[0] - other.at[0], touch.at[1] - other.at[1]);
    const after = Math.hypot(at[0] - other.at[0], at[1] - other.at[1]);
    this.#map.panBy((at[0] - touch.at[0]) / 2, (at[1] - touch.at[1]) / 2);
    if (before > 0 && after > 0) this.#map.pinch(after / before, [(at[0] + other.at[0]) / 2, (at[1] + other.at[1]) / 2]);
    this.#rotate(touch.at, other.at, at);
  }

  #rotate(from: Vec2, other: Vec2, to: Vec2): void {
    const angle = ([x, y]: Vec2): number => Math.atan2(y - other[1], x - other[0]);
    const turned = angle(to) - angle(from);
    this.#map.rotateBy(turned - 2 * Math.PI * Math.round(turned / (2 * Math.PI)));
  }

  #up(event: PointerEvent, meant: boolean): void {
    if (this.#rotatingFrom && (event.button === 2 || !meant)) {
      this.#rotatingFrom = null;
      this.#map.endGesture();
    }
    const touch = this.#pointers.get(event.pointerId);
    if (!touch) return;
    this.#pointers.delete(event.pointerId);
    if (this.#pointers.size > 0) return;
    this.#map.endGesture();
    this.#map.container.classList.remove("map3d-dragging");
    if (!meant) return;
    if (this.#moved) this.#glide(event.timeStamp);
    else this.#tap(touch.at, event.timeStamp);
  }

  #glide(now: number): void {
    const recent = this.#recentPoints.filter(({ ms }) => now - ms < VELOCITY_MS);
    const [first, last] = [recent[0], recent.at(-1)];
    const ms = first && last ? last.ms - first.ms : 0;
    if (!first || !last || ms < 10) return;
    const velocity: Vec2 = [(last.at[0] - first.at[0]) / ms, (last.at[1] - first.at[1]) / ms];
    if (Math.hypot(...velocity) > 0.15) this.#map.startInertia(velocity);
  }

  #tap(at: Vec2, now: number): void {
    const last = this.#lastTap;
    const double = last && now - last.ms < DOUBLE_TAP_MS && Math.hypot(at[0] - last.at[0], at[1] - last.at[1]) < DOUBLE_TAP_PX;
    this.#lastTap = double ? null : { at, ms: now };
    if (double) this.#map.zoomBy(1, at);
    else this.#map.tap(at);
  }

  #wheel(event: WheelEvent): void {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 24 : event.deltaMode === WheelEvent.DOM_DELTA_PAGE ? 240 : 1;
    const pixels = Math.max(-240, Math.min(240, event.deltaY * lines));
    this.#map.zoomBy(-pixels / (event.ctrlKey ? 80 : 260), this.#toScreen(event));
  }
}

import { element, positionIn } from "../core/dom";
import type { Vec2 } from "../core/vec";
import { Cooperation } from "./cooperation";
import type { FilledOptions } from "./options";

/** A map as controlled by gestures. Screen positions are CSS pixels from the container's top left corner. */
export interface GestureTarget {
  readonly container: HTMLElement;
  /** A gesture has started: stops movements. */
  startGesture(): void;
  panBy(dx: number, dy: number): unknown;
  /** Moves the picture with a pointer. */
  dragBy(dx: number, dy: number): void;
  readonly language: string;
  /** `boxZoom`: whether a drag with Shift draws a rectangle to zoom to. */
  readonly options: Pick<FilledOptions, "boxZoom" | "gestureHandling">;
  zoomToRect(from: Vec2, to: Vec2): void;
  startInertia(velocity: Vec2): void;
  /** Zooms at once, without animation. */
  pinch(factor: number, anchor: Vec2): unknown;
  zoomBy(delta: number, anchor: Vec2): unknown;
  /** Rotates the picture clockwise. */
  rotateBy(rad: number): void;
  /** The last pointer was released. */
  endGesture(): void;
  tap(at: Vec2): void;
  /** The pointer moves without a button; null: it leaves the map. */
  hover(at: Vec2 | null): void;
}

interface Pointer {
  at: Vec2;
  readonly start: Vec2;
}

const TAP_PX = 6;
const DOUBLE_TAP_MS = 320;
const DOUBLE_TAP_PX = 28;
const VELOCITY_MS = 90;
/** Rotation per pixel of a drag with the right button. */
const ROTATION_RAD_PER_PX = (0.4 * Math.PI) / 180;

/** Handles mouse, touch and pen on the canvas: drag, pinch, wheel, tap, double tap, and a rectangle drawn with Shift. */
export class Gestures {
  readonly #map: GestureTarget;
  readonly #canvas: HTMLCanvasElement;
  readonly #pointers = new Map<number, Pointer>();
  readonly #listeners = new AbortController();
  readonly #cooperation: Cooperation;
  #recentPoints: { at: Vec2; ms: number }[] = [];
  #moved = false;
  /** Last position of a drag with the right button. */
  #rotatingFrom: Vec2 | null = null;
  /** The rectangle that is drawn, from the press of the button on. */
  #box: HTMLElement | null = null;
  #lastTap: { at: Vec2; ms: number } | null = null;

  constructor(map: GestureTarget, canvas: HTMLCanvasElement) {
    this.#map = map;
    this.#canvas = canvas;
    this.#cooperation = new Cooperation(map.container, map.options.gestureHandling, map.language);
    const { signal } = this.#listeners;
    canvas.addEventListener("pointerdown", (event) => this.#down(event), { signal });
    canvas.addEventListener("pointermove", (event) => this.#move(event), { signal });
    canvas.addEventListener("pointerup", (event) => this.#up(event, true), { signal });
    canvas.addEventListener("pointercancel", (event) => this.#up(event, false), { signal });
    canvas.addEventListener("pointerleave", () => this.#map.hover(null), { signal });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault(), { signal });
    canvas.addEventListener("touchmove", (event) => this.#keepTouch(event), { signal, passive: false });
    canvas.addEventListener("wheel", (event) => this.#wheel(event), { signal, passive: false });
  }

  destroy(): void {
    this.#listeners.abort();
    this.#cooperation.destroy();
  }

  #toScreen(event: MouseEvent): Vec2 {
    return positionIn(this.#canvas, event);
  }

  /** Keeps a touch from scrolling the page; cooperative, only one with several fingers. */
  #keepTouch(event: TouchEvent): void {
    if (event.cancelable && (event.touches.length > 1 || !this.#cooperation.isActive)) event.preventDefault();
  }

  #down(event: PointerEvent): void {
    const at = this.#toScreen(event);
    if (event.pointerType === "mouse" && event.button === 2) this.#rotatingFrom = at;
    else if (event.pointerType === "mouse" && event.button !== 0) return;
    this.#canvas.setPointerCapture(event.pointerId);
    if (this.#rotatingFrom) return;
    this.#map.startGesture();
    this.#moved = this.#pointers.size > 0;
    if (event.shiftKey && event.pointerType === "mouse" && this.#map.options.boxZoom) this.#box = element("div", "map3d-box");
    this.#pointers.set(event.pointerId, { at, start: at });
    this.#recentPoints = [];
  }

  #move(event: PointerEvent): void {
    const pointer = this.#pointers.get(event.pointerId);
    const at = this.#toScreen(event);
    if (this.#rotatingFrom) {
      this.#map.rotateBy((at[0] - this.#rotatingFrom[0]) * ROTATION_RAD_PER_PX);
      this.#rotatingFrom = at;
      return;
    }
    if (!pointer) {
      if (event.pointerType === "mouse") this.#map.hover(at);
      return;
    }
    if (!this.#moved && Math.hypot(at[0] - pointer.start[0], at[1] - pointer.start[1]) < TAP_PX) return;
    this.#moved = true;
    if (event.pointerType === "touch" && this.#pointers.size === 1 && this.#cooperation.isActive) {
      this.#cooperation.showHint(true);
      return;
    }
    if (this.#box) this.#map.container.append(this.#box);
    else this.#map.container.classList.add("map3d-dragging");
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) this.#pinch(pointer, other, at);
    else this.#drag(pointer, at, event);
    pointer.at = at;
  }

  #drag(pointer: Pointer, at: Vec2, event: PointerEvent): void {
    if (this.#box) {
      drawBox(this.#box, pointer.start, at);
      return;
    }
    this.#map.dragBy(at[0] - pointer.at[0], at[1] - pointer.at[1]);
    // When frames are slow, one event combines several: their own positions and times give the pointer's speed.
    const all = "getCoalescedEvents" in event ? event.getCoalescedEvents() : [];
    const points = (all.length > 0 ? all : [event]).map((each) => ({ at: this.#toScreen(each), ms: each.timeStamp }));
    this.#recentPoints = [...this.#recentPoints, ...points].filter(({ ms }) => event.timeStamp - ms < VELOCITY_MS);
  }

  #pinch(pointer: Pointer, other: Pointer, at: Vec2): void {
    const startDistance = Math.hypot(pointer.at[0] - other.at[0], pointer.at[1] - other.at[1]);
    const distance = Math.hypot(at[0] - other.at[0], at[1] - other.at[1]);
    this.#map.panBy((at[0] - pointer.at[0]) / 2, (at[1] - pointer.at[1]) / 2);
    if (startDistance > 0 && distance > 0)
      this.#map.pinch(distance / startDistance, [(at[0] + other.at[0]) / 2, (at[1] + other.at[1]) / 2]);
    this.#rotate(pointer.at, other.at, at);
  }

  #rotate(from: Vec2, other: Vec2, to: Vec2): void {
    const angle = ([x, y]: Vec2): number => Math.atan2(y - other[1], x - other[0]);
    const turned = angle(to) - angle(from);
    this.#map.rotateBy(turned - 2 * Math.PI * Math.round(turned / (2 * Math.PI)));
  }

  #up(event: PointerEvent, completed: boolean): void {
    if (this.#rotatingFrom && (event.button === 2 || !completed)) {
      this.#rotatingFrom = null;
      this.#map.endGesture();
    }
    const pointer = this.#pointers.get(event.pointerId);
    if (!pointer) return;
    this.#pointers.delete(event.pointerId);
    if (this.#pointers.size > 0) return;
    this.#map.endGesture();
    this.#map.container.classList.remove("map3d-dragging");
    const box = this.#box;
    this.#box = null;
    box?.remove();
    if (!completed) return;
    if (this.#moved && box) this.#map.zoomToRect(pointer.start, pointer.at);
    else if (this.#moved) this.#glide(event.timeStamp);
    else this.#tap(pointer.at, event.timeStamp);
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
    if (this.#cooperation.isActive && !event.ctrlKey && !event.metaKey) {
      this.#cooperation.showHint(false);
      return;
    }
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 24 : event.deltaMode === WheelEvent.DOM_DELTA_PAGE ? 240 : 1;
    const pixels = Math.max(-240, Math.min(240, event.deltaY * lines));
    this.#map.zoomBy(-pixels / (event.ctrlKey ? 80 : 260), this.#toScreen(event));
  }
}

function drawBox({ style }: HTMLElement, [x0, y0]: Vec2, [x1, y1]: Vec2): void {
  Object.assign(style, {
    left: `${String(Math.min(x0, x1))}px`,
    top: `${String(Math.min(y0, y1))}px`,
    width: `${String(Math.abs(x1 - x0))}px`,
    height: `${String(Math.abs(y1 - y0))}px`,
  });
}

import type { OverlayHost } from "../core/overlayHost";
import type { Vec2, Vec3 } from "../core/vec";

const START_PX = 4;
const STEP_PX = 10;
const KEYS: Readonly<Record<string, Vec2>> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Moves something that has a position over the surface: under the pointer, or by arrow keys. Where no surface is known it stays. */
export function enableDragging(handle: HTMLElement, map: OverlayHost, position: () => Vec3, tell: (type: "dragstart" | "drag" | "dragend", position: Vec3) => void): void {
  let hand: { readonly id: number; readonly from: Vec2; readonly grip: Vec2; moved: boolean } | undefined;
  const place = (x: number, y: number): void => {
    const on = map.findSurfaceAt([x, y]);
    if (on) tell("drag", on);
  };
  handle.classList.add("map3d-marker-loose");
  handle.setAttribute("aria-keyshortcuts", Object.keys(KEYS).join(" "));
  handle.addEventListener("pointerdown", (event) => {
    const at = map.project(position());
    if (hand || event.button !== 0 || !at) return;
    handle.setPointerCapture(event.pointerId);
    hand = { id: event.pointerId, from: [event.clientX, event.clientY], grip: [at[0] - event.clientX, at[1] - event.clientY], moved: false };
  });
  handle.addEventListener("pointermove", (event) => {
    if (hand?.id !== event.pointerId) return;
    if (!hand.moved && Math.hypot(event.clientX - hand.from[0], event.clientY - hand.from[1]) < START_PX) return;
    if (!hand.moved) tell("dragstart", position());
    hand.moved = true;
    place(event.clientX + hand.grip[0], event.clientY + hand.grip[1]);
  });
  const ended = (event: PointerEvent): void => {
    if (hand?.id !== event.pointerId) return;
    if (hand.moved) {
      tell("dragend", position());
      // The click that follows a drag is none.
      const swallow = (click: Event): void => { click.stopImmediatePropagation(); };
      handle.addEventListener("click", swallow, { capture: true, once: true });
      setTimeout(() => { handle.removeEventListener("click", swallow, { capture: true }); });
    }
    hand = undefined;
  };
  handle.addEventListener("pointerup", ended);
  handle.addEventListener("pointercancel", ended);
  handle.addEventListener("keydown", (event) => {
    const [step, at] = [KEYS[event.key], map.project(position())];
    if (!step || !at || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const far = event.shiftKey ? 1 : STEP_PX;
    tell("dragstart", position());
    place(at[0] + far * step[0], at[1] + far * step[1]);
    tell("dragend", position());
  });
}

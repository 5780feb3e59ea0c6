import { positionIn } from "../core/dom";
import type { EnableDragging } from "../core/overlayHost";
import type { Vec2 } from "../core/vec";

const START_PX = 4;
const STEP_PX = 10;
const KEYS: Readonly<Record<string, Vec2>> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Lets the user drag a positioned element over the surface, with the pointer or the arrow keys. It stays where it is where no surface is known. */
export const enableDragging: EnableDragging = (handle, map, position, onDrag) => {
  let drag: { readonly id: number; readonly from: Vec2; readonly offset: Vec2; moved: boolean } | undefined;
  const moveTo = (x: number, y: number): void => {
    const surface = map.findSurfaceAt([x, y]);
    if (surface) onDrag("drag", surface);
  };
  handle.classList.add("map3d-marker-draggable");
  handle.setAttribute("aria-keyshortcuts", Object.keys(KEYS).join(" "));
  handle.addEventListener("pointerdown", (event) => {
    const start = position();
    const at = start && map.project(start);
    if (drag || event.button !== 0 || !at) return;
    handle.setPointerCapture(event.pointerId);
    const from = positionIn(map.container, event);
    drag = { id: event.pointerId, from, offset: [at[0] - from[0], at[1] - from[1]], moved: false };
  });
  handle.addEventListener("pointermove", (event) => {
    if (drag?.id !== event.pointerId) return;
    const [x, y] = positionIn(map.container, event);
    if (!drag.moved && Math.hypot(x - drag.from[0], y - drag.from[1]) < START_PX) return;
    const start = position();
    if (!drag.moved && start) onDrag("dragstart", start);
    drag.moved = true;
    moveTo(x + drag.offset[0], y + drag.offset[1]);
  });
  const ended = (event: PointerEvent): void => {
    if (drag?.id !== event.pointerId) return;
    const end = position();
    if (drag.moved && end) {
      onDrag("dragend", end);
      // Suppresses the click that follows a drag.
      const suppress = (click: Event): void => click.stopImmediatePropagation();
      handle.addEventListener("click", suppress, { capture: true, once: true });
      setTimeout(() => {
        handle.removeEventListener("click", suppress, { capture: true });
      });
    }
    drag = undefined;
  };
  handle.addEventListener("pointerup", ended);
  handle.addEventListener("pointercancel", ended);
  handle.addEventListener("keydown", (event) => {
    const [step, start] = [KEYS[event.key], position()];
    const at = start && map.project(start);
    if (!step || !at || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const step_px = event.shiftKey ? 1 : STEP_PX;
    onDrag("dragstart", start);
    moveTo(at[0] + step_px * step[0], at[1] + step_px * step[1]);
    onDrag("dragend", position() ?? start);
  });
};

import type { GestureTarget } from "./gestures";

export interface KeyboardTarget extends GestureTarget {
  panBy(dx: number, dy: number, options?: { smooth?: boolean }): unknown;
  /** +1: the next direction counter-clockwise. */
  rotate(step: number): unknown;
  /** +1: steeper. */
  tilt(step: number): unknown;
}

const STEP_PX = 90;
const PAN: Record<string, readonly [number, number]> = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const ZOOM: Record<string, number> = { "+": 1, "=": 1, "-": -1, _: -1 };
const TURN: Record<string, number> = { "[": 1, "]": -1, q: 1, e: -1 };
const TILT: Record<string, number> = { PageUp: 1, PageDown: -1 };

/** Handles keys while the map itself has the focus: arrows pan, + and − zoom, q and e (or [ and ]) rotate, Page Up and Page Down change the pitch, Enter clicks the centre. */
export function listenToKeys(map: KeyboardTarget, signal: AbortSignal): void {
  const { container } = map;
  container.tabIndex = 0;
  const onKey = (event: KeyboardEvent): void => {
    if (event.target !== container || event.ctrlKey || event.metaKey || event.altKey) return;
    const [pan, zoom, rotation, tilt] = [PAN[event.key], ZOOM[event.key], TURN[event.key], TILT[event.key]];
    const centre = [container.clientWidth / 2, container.clientHeight / 2] as const;
    if (pan) map.panBy(pan[0] * STEP_PX, pan[1] * STEP_PX, { smooth: true });
    else if (zoom !== undefined) map.zoomBy(zoom, centre);
    else if (rotation !== undefined) map.rotate(rotation);
    else if (tilt !== undefined) map.tilt(tilt);
    else if (event.key === "Enter") map.tap(centre);
    else return;
    event.preventDefault();
  };
  container.addEventListener("keydown", onKey, { signal });
}

import type { Map3D } from "./map3d.module.js";
import type { Orbit } from "./map3d-orbit.module.js";
import { prefersReducedMotion } from "../src/core/dom";
import { GESTURES } from "./dom";

/** A round takes 14 seconds. */
const RAD_PER_S = (2 * Math.PI) / 14;
/** It gets up to speed, and slows down, over this angle. */
const EASE_RAD = 0.5;
/** Fewer directions make no round. */
const MIN_DIRECTIONS = 3;
const DELAY_MS = 600;
/** A long frame, such as in a hidden tab, does not make the map jump. */
const LONGEST_FRAME_MS = 100;
/** Set in a session that has seen the opening. */
const SEEN = "map3d-opening";

/** Turns the map once around when it opens, slowly: once in a session, and until the first touch, turn of the wheel or key. Never with reduced motion, saved data, or fewer than three directions. */
export function bindOpening(view: Map3D, turn: Orbit): void {
  const pitch = view.directions.find(({ id }) => id === view.direction)?.pitch_deg;
  const directions = view.directions.filter(({ pitch_deg }) => pitch_deg === pitch);
  if (directions.length < MIN_DIRECTIONS || view.drawer !== "webgl" || view.options.dataSaver || prefersReducedMotion() || wasSeen())
    return;
  let [stopped, turned, last] = [false, 0, 0];
  const stop = (): void => {
    stopped = true;
    for (const type of GESTURES) removeEventListener(type, stop, true);
    turn.endGesture();
  };
  const step = (now: number): void => {
    if (stopped) return;
    const seconds = Math.min(now - last, LONGEST_FRAME_MS) / 1000;
    last = now;
    // Waits while the tiles of the next direction load.
    if (!view.isTurning) {
      const eased = Math.min(1, 0.15 + Math.min(turned, 2 * Math.PI - turned) / EASE_RAD);
      const angle = RAD_PER_S * seconds * eased;
      turned += angle;
      turn.rotateBy(angle);
    }
    if (turned >= 2 * Math.PI) stop();
    else requestAnimationFrame(step);
  };
  for (const type of GESTURES) addEventListener(type, stop, true);
  view.once("idle", () => {
    setTimeout(() => {
      if (stopped) return;
      last = performance.now();
      requestAnimationFrame(step);
    }, DELAY_MS);
  });
}

/** Whether this session has seen the opening. Embedded pages may have no storage. */
function wasSeen(): boolean {
  try {
    const seen = sessionStorage.getItem(SEEN) !== null;
    sessionStorage.setItem(SEEN, "");
    return seen;
  } catch {
    return false;
  }
}

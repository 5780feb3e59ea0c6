import type { Map3D } from "./map3d.module.js";
import { byId } from "./dom";

/** Shorter waits are not shown, ms. */
const DELAY_MS = 400;

/** Shows a bar at the top while tiles in view are missing, or a turn waits for its tiles. */
export function bindLoading(view: Map3D): void {
  const bar = byId("loading");
  let since_ms: number | null = performance.now();
  view.on("move", () => {
    since_ms ??= performance.now();
  });
  view.on("idle", () => {
    since_ms = null;
  });
  setInterval(() => {
    if (view.isTurning) since_ms ??= performance.now();
    const waits = since_ms !== null && performance.now() - since_ms >= DELAY_MS && navigator.onLine;
    bar.hidden = !waits || document.querySelector(".failed") !== null;
  }, DELAY_MS / 2);
}

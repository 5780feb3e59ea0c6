import { clamp, type Box3 } from "../core/vec";
import { projectedBox, zoomToFit, type Camera } from "../geo/camera";

/** The zoom goes this far below the one that fits everything. */
const OUT = 1.2;
/** The zoom goes this far beyond the deepest level. */
const IN = 2;

/** Computes the zoom limits: everything small in the middle; a tile pixel four CSS pixels wide. */
export function computeZoomLimits(camera: Camera, box: Box3): [number, number] {
  const [low, high] = projectedBox(camera.frame, box);
  const all = zoomToFit(camera, high[0] - low[0], high[1] - low[1], 0);
  const deepest = camera.frame.zmax + IN;
  return [Math.min(all - OUT, deepest), deepest];
}

/** Limits the camera's zoom, and keeps the screen's centre over the content. */
export function limitCamera(camera: Camera, box: Box3): Camera {
  const [low, high] = projectedBox(camera.frame, box);
  const zoom = clamp(camera.zoom, ...computeZoomLimits(camera, box));
  return { ...camera, zoom, u: clamp(camera.u, low[0], high[0]), v: clamp(camera.v, low[1], high[1]) };
}

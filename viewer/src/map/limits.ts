import { clamp, type Box3, type Vec3 } from "../core/vec";
import { depthAtHeight, localFromUvd, uvdFromLocal } from "../geo/axes";
import { cssPixelM, projectedBox, uvFromScreen, zoomToFit, type Camera } from "../geo/camera";
import type { View } from "../geo/manifest";

/** The zoom goes this far below the one that fits everything. */
const OUT = 1.2;
/** The zoom goes this far beyond the deepest level. */
const IN = 2;

/** A drag goes beyond the bounds by at most this share of the screen. */
const SOFT = 0.25;

/** Limits of a camera; boxes are local. */
export interface Limits {
  /** The content. */
  readonly box: Box3;
  /** Where the screen's centre may be. */
  readonly bounds: Box3;
  readonly minZoom: number | undefined;
  readonly maxZoom: number | undefined;
}

/** Computes the zoom limits. Without options: everything small in the middle; a tile pixel four CSS pixels wide. */
export function computeZoomLimits(camera: Camera, { box, minZoom, maxZoom }: Limits): [number, number] {
  const [low, high] = projectedBox(camera.frame, box);
  const all = zoomToFit(camera, high[0] - low[0], high[1] - low[1], 0);
  const most = maxZoom ?? camera.frame.zmax + IN;
  const least = minZoom ?? Math.min(all - OUT, most);
  return [least, Math.max(least, most)];
}

/** Limits the camera's zoom, and keeps the screen's centre within the bounds. */
export function limitCamera(camera: Camera, limits: Limits): Camera {
  const [low, high] = projectedBox(camera.frame, limits.bounds);
  const zoom = clamp(camera.zoom, ...computeZoomLimits(camera, limits));
  return { ...camera, zoom, u: clamp(camera.u, low[0], high[0]), v: clamp(camera.v, low[1], high[1]) };
}

/** Moves the picture by CSS pixels; beyond the bounds with growing resistance, as on a spring. */
export function panSoftly(camera: Camera, dx: number, dy: number, { bounds }: Limits): Camera {
  const [low, high] = projectedBox(camera.frame, bounds);
  const px = cssPixelM(camera);
  const u = resist(camera.u, camera.u - dx * px, low[0], high[0], SOFT * camera.width * px);
  return { ...camera, u, v: resist(camera.v, camera.v + dy * px, low[1], high[1], SOFT * camera.height * px) };
}

function resist(from: number, to: number, low: number, high: number, most: number): number {
  const inside = clamp(to, low, high);
  const [before, after] = [from - clamp(from, low, high), to - inside];
  if (Math.abs(after) <= Math.abs(before)) return to;
  return inside + clamp(before + (after - before) * Math.max(1 - Math.abs(before) / most, 0) ** 2, -most, most);
}

/** Content higher than this share of its width is an object, not a landscape, and is shown whole. */
const FLAT = 0.3;
/** Share of the screen that a landscape fills, number of points along each side where that is measured, and the most levels that it is enlarged. */
const [FILLED, POINTS, ENLARGED] = [0.97, 12, 3];

/** Enlarges the view of a landscape until it fills the screen; returns the same camera where that does not help. @param center local, by default that of the ground @param most the largest zoom */
export function fillScreen(camera: Camera, { frame, occupancy }: View, [low, high]: Box3, center?: Vec3, most = Infinity): Camera {
  if (high[2] - low[2] > FLAT * Math.max(high[0] - low[0], high[1] - low[1])) return camera;
  const [centerU, centerV] = uvdFromLocal(frame.axes, center ?? [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]]);
  const count = 2 ** frame.zmax;
  const hasContent = (at: Camera, k: number): boolean => {
    const [u, v] = uvFromScreen(at, [((k % POINTS) * at.width) / (POINTS - 1), (Math.floor(k / POINTS) * at.height) / (POINTS - 1)]);
    // Tiles at the edge have content in a part of them only: the ground of the box ends there.
    const d = depthAtHeight(frame.axes, v, low[2]);
    if (d !== null && localFromUvd(frame.axes, [u, v, d]).some((at, axis) => axis < 2 && (at < low[axis as 0] || at > high[axis as 0])))
      return false;
    const [x, y] = [Math.floor(((u - frame.u0) / frame.size) * count), Math.floor(((frame.v0 - v) / frame.size) * count)];
    return Math.min(x, y) >= 0 && Math.max(x, y) < count && occupancy.has({ z: frame.zmax, x, y });
  };
  for (let step = 0; step <= 10 * ENLARGED; step++) {
    const larger = { ...camera, u: centerU, v: centerV, zoom: camera.zoom + step / 10 };
    if (step > 0 && larger.zoom > most) break;
    if (Array.from({ length: POINTS ** 2 }).filter((_, k) => hasContent(larger, k)).length >= FILLED * POINTS ** 2) return larger;
  }
  return camera;
}

import type { Box3, Vec2, Vec3 } from "../core/vec";
import { corners } from "../core/vec";
import { uvdFromLocal } from "./axes";
import { pixelM, type Frame } from "./frame";

/** A view's camera: the frame, U and V of the screen's centre, and the zoom. Screen positions are CSS pixels from the top left. */
export interface Camera {
  readonly frame: Frame;
  readonly u: number;
  readonly v: number;
  /** At an integer zoom, one tile pixel of that level is one CSS pixel. */
  readonly zoom: number;
  readonly width: number;
  readonly height: number;
}

/** Metres per CSS pixel. */
export const cssPixelM = (camera: Camera): number => pixelM(camera.frame, camera.zoom);

export function uvFromScreen(camera: Camera, [x, y]: Vec2): Vec2 {
  const px = cssPixelM(camera);
  return [camera.u + (x - camera.width / 2) * px, camera.v - (y - camera.height / 2) * px];
}

export function screenFromUv(camera: Camera, [u, v]: Vec2): Vec2 {
  const px = cssPixelM(camera);
  return [(u - camera.u) / px + camera.width / 2, (camera.v - v) / px + camera.height / 2];
}

export function screenFromLocal(camera: Camera, local: Vec3): Vec2 {
  const [u, v] = uvdFromLocal(camera.frame.axes, local);
  return screenFromUv(camera, [u, v]);
}

/** Changes the zoom and keeps the point under `anchor` in place. */
export function zoomedAt(camera: Camera, zoom: number, anchor: Vec2): Camera {
  const [u, v] = uvFromScreen(camera, anchor);
  const px = pixelM(camera.frame, zoom);
  return { ...camera, zoom, u: u - (anchor[0] - camera.width / 2) * px, v: v + (anchor[1] - camera.height / 2) * px };
}

/** Projects a local box: [[min U, min V], [max U, max V]]. */
export function projectedBox(frame: Frame, box: Box3): readonly [Vec2, Vec2] {
  const points = corners(box).map((corner) => uvdFromLocal(frame.axes, corner));
  const [us, vs] = [points.map((p) => p[0]), points.map((p) => p[1])];
  return [
    [Math.min(...us), Math.min(...vs)],
    [Math.max(...us), Math.max(...vs)],
  ];
}

/** Returns the largest zoom at which width × height metres fit the screen with `padding` CSS pixels on each side. */
export function zoomToFit(camera: Camera, width_m: number, height_m: number, padding: number): number {
  const across = Math.max(camera.width - 2 * padding, 1);
  const down = Math.max(camera.height - 2 * padding, 1);
  const px = Math.max(width_m / across, height_m / down, 1e-9);
  return Math.log2(camera.frame.size / (camera.frame.tilePx * px));
}

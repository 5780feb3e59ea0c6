import { corners, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import { cssPixelM, type Camera } from "../geo/camera";
import type { Frame } from "../geo/frame";
import { towardsLight, type Light } from "../geo/light";

/** Returns the range of D of local boxes, metres; null without boxes. */
export function depthRangeOf(boxes: readonly Box3[], { axes }: Frame): Vec2 | null {
  const all = boxes.flatMap((box) => corners(box).map((corner) => uvdFromLocal(axes, corner)[2]));
  return all.length === 0 ? null : [Math.min(...all), Math.max(...all)];
}

/** A rectangle of the screen: device pixels from the top left. */
export interface ScreenRect {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

interface Screen {
  readonly camera: Camera;
  /** Device pixels. */
  readonly width: number;
  readonly height: number;
  readonly dpr: number;
}

/** Sizes are multiples of this, so that small movements do not need new textures. */
const SIZE_STEP_PX = 128;
/** Margin for lines and points, which are drawn thicker than their boxes. */
const MARGIN_PX = 4;

/** Returns the rectangle of the screen that contains local boxes; null when they are out of view. */
export function screenRectOf(boxes: readonly Box3[], { camera, width, height, dpr }: Screen): ScreenRect | null {
  const px = cssPixelM(camera) / dpr;
  const points = boxes.flatMap((box) => corners(box).map((corner) => uvdFromLocal(camera.frame.axes, corner)));
  const [left, top] = cornerOf(camera);
  const across = spanOf(
    points.map(([u]) => (u - left) / px),
    width,
  );
  const down = spanOf(
    points.map(([, v]) => (top - v) / px),
    height,
  );
  return across && down && { x: across[0], width: across[1], y: down[0], height: down[1] };
}

/** Returns U and V of a rectangle's top left corner, and metres per device pixel. */
export function screenRectCorner({ x, y }: ScreenRect, { camera, dpr }: Screen): readonly [u: number, v: number, px_m: number] {
  const px = cssPixelM(camera) / dpr;
  const [left, top] = cornerOf(camera);
  return [left + x * px, top - y * px, px];
}

/** Returns U and V of the screen's top left corner. */
function cornerOf(camera: Camera): Vec2 {
  const px = cssPixelM(camera);
  return [camera.u - (camera.width / 2) * px, camera.v + (camera.height / 2) * px];
}

/** Returns the first pixel and the number of pixels within the screen; null when all are outside. */
function spanOf(values: readonly number[], screen: number): Vec2 | null {
  const low = Math.max(0, Math.floor(Math.min(...values)) - MARGIN_PX);
  const high = Math.min(screen, Math.ceil(Math.max(...values)) + MARGIN_PX);
  if (!(low < high)) return null;
  const size = Math.min(screen, SIZE_STEP_PX * Math.ceil((high - low) / SIZE_STEP_PX));
  return [Math.min(low, screen - size), size];
}

/** The map's light in three.js's units; three.js divides irradiance by π. */
export interface ThreeLighting {
  readonly sky_rgb: Vec3;
  readonly sky: number;
  readonly sun_rgb: Vec3;
  readonly sun: number;
  /** Unit vector towards the sun, local. */
  readonly towards: Vec3;
}

/** Converts the map's light. An unlit map shows stored colours, which uniform white light reproduces. */
export function threeLighting(light: Readonly<Light>): ThreeLighting {
  const { lit, sky_rgb, sun_rgb, ambient, diffuse } = light;
  return {
    sky_rgb: lit ? sky_rgb : [1, 1, 1],
    sky: Math.PI * (lit ? ambient : 1),
    sun_rgb,
    sun: lit ? Math.PI * diffuse : 0,
    towards: towardsLight(light),
  };
}

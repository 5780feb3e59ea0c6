import { corners, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import { cssPixelM, type Camera } from "../geo/camera";
import type { Frame } from "../geo/frame";
import { towardsLight, type Light } from "../geo/light";

/** Least and greatest D of boxes (local), metres; null without any. */
export function depthsOf(boxes: readonly Box3[], { axes }: Frame): Vec2 | null {
  const all = boxes.flatMap((box) => corners(box).map((corner) => uvdFromLocal(axes, corner)[2]));
  return all.length === 0 ? null : [Math.min(...all), Math.max(...all)];
}

/** A part of the screen: device pixels from the left top. */
export interface Part {
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

/** Sizes are multiples of it, so that what moves a little needs no other textures. */
const STEP_PX = 128;
/** Room for what is drawn thicker than it is. */
const ROOM_PX = 4;

/** The part of the screen that boxes (local) are seen in; null when that is none. */
export function partOf(boxes: readonly Box3[], { camera, width, height, dpr }: Screen): Part | null {
  const px = cssPixelM(camera) / dpr;
  const points = boxes.flatMap((box) => corners(box).map((corner) => uvdFromLocal(camera.frame.axes, corner)));
  const [left, top] = cornerOf(camera);
  const across = spanOf(points.map(([u]) => (u - left) / px), width);
  const down = spanOf(points.map(([, v]) => (top - v) / px), height);
  return across && down && { x: across[0], width: across[1], y: down[0], height: down[1] };
}

/** U and V of a part's left top corner, and metres a device pixel. */
export function groundOf({ x, y }: Part, { camera, dpr }: Screen): readonly [u: number, v: number, px_m: number] {
  const px = cssPixelM(camera) / dpr;
  const [left, top] = cornerOf(camera);
  return [left + x * px, top - y * px, px];
}

/** U and V of the screen's left top corner. */
function cornerOf(camera: Camera): Vec2 {
  const px = cssPixelM(camera);
  return [camera.u - (camera.width / 2) * px, camera.v + (camera.height / 2) * px];
}

/** First pixel and how many of a screen's; null: all lie outside. */
function spanOf(values: readonly number[], screen: number): Vec2 | null {
  const low = Math.max(0, Math.floor(Math.min(...values)) - ROOM_PX);
  const high = Math.min(screen, Math.ceil(Math.max(...values)) + ROOM_PX);
  if (!(low < high)) return null;
  const size = Math.min(screen, STEP_PX * Math.ceil((high - low) / STEP_PX));
  return [Math.min(low, screen - size), size];
}

/** The images' light for three.js, which divides by π what falls on a surface. */
export interface Lamps {
  readonly sky_rgb: Vec3;
  readonly sky: number;
  readonly sun_rgb: Vec3;
  readonly sun: number;
  /** Unit, local. */
  readonly towards: Vec3;
}

/** Where the images show colours as they are stored, white light from everywhere does so. */
export function lampsOf(light: Readonly<Light>): Lamps {
  const { lit, sky_rgb, sun_rgb, ambient, diffuse } = light;
  return { sky_rgb: lit ? sky_rgb : [1, 1, 1], sky: Math.PI * (lit ? ambient : 1), sun_rgb, sun: lit ? Math.PI * diffuse : 0, towards: towardsLight(light) };
}

import { checkPosition, isVector, type Position } from "../core/position";
import { add, boxCenter, sub, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { depthAtHeight, localFromUvd, uvdFromLocal } from "../geo/axes";
import { cssPixelM, projectedBox, uvFromScreen, zoomToFit, type Camera } from "../geo/camera";
import type { Rendering, View } from "../geo/manifest";
import { worldPosition } from "../geo/position";
import { fillScreen } from "./limits";
import type { MapOptions } from "./options";
import type { Size } from "./viewport";

/** A box by two opposite corners. */
export type Bounds = readonly [Position, Position];

/** @throws UsageError for anything but two positions */
export function checkBounds(bounds: Bounds, name: string): void {
  for (const k of [0, 1] as const) checkPosition((bounds as Bounds | undefined)?.[k] as Position, name);
}

/** Returns the local box between two corners. */
export function localBox(bounds: Bounds, rendering: Rendering): Box3 {
  const [a, b] = bounds.map((corner) => sub(worldPosition(corner, rendering), rendering.json.origin)) as [Vec3, Vec3];
  const pick = (choose: (a: number, b: number) => number): Vec3 => [0, 1, 2].map((k) => choose(a[k as 0], b[k as 0])) as unknown as Vec3;
  return [pick(Math.min), pick(Math.max)];
}

/** Moves a world position to the centre. */
export function centerCamera(camera: Camera, { json }: Rendering, position: Vec3, zoom = camera.zoom): Camera {
  const [u, v] = uvdFromLocal(camera.frame.axes, sub(position, json.origin));
  return { ...camera, u, v, zoom };
}

/** Moves the picture by CSS pixels. */
export function panCamera(camera: Camera, dx: number, dy: number): Camera {
  const px = cssPixelM(camera);
  return { ...camera, u: camera.u - dx * px, v: camera.v + dy * px };
}

/** Fits a local box into the camera. */
export function fitCamera(camera: Camera, box: Box3, padding: number, maxZoom: number): Camera {
  const [low, high] = projectedBox(camera.frame, box);
  const [u, v] = uvdFromLocal(camera.frame.axes, boxCenter(box));
  return { ...camera, u, v, zoom: Math.min(zoomToFit(camera, high[0] - low[0], high[1] - low[1], padding), maxZoom) };
}

/** Makes the camera of the first picture: about the option `center`, else the rendering's start, else of everything. */
export function makeFirstCamera(
  rendering: Rendering,
  { frame }: Pick<View, "frame">,
  { width, height }: Pick<Size, "width" | "height">,
  { center, zoom, cover }: MapOptions,
): Camera {
  const { json } = rendering;
  const padding = Math.min(width, height) * 0.04;
  const whole = fitCamera({ frame, u: 0, v: 0, zoom: 0, width, height }, json.box, padding, json.zmax);
  const own = center && isVector(center) ? sub(center, json.origin) : undefined;
  const local = own ?? json.start?.local ?? boxCenter(json.box);
  const radius = own ? undefined : json.start?.radius_m;
  // The first objects stay in view, and nothing is enlarged beyond its resolution.
  const most = Math.min(json.zmax, radius ? zoomToFit(whole, 2 * radius, 2 * radius, padding) : json.zmax);
  const fitted = cover ? fillScreen(whole, rendering.views.get(frame.id) as View, json.box, local, most) : whole;
  // Away from the middle, everything is never in view: show the objects there.
  const isAside = cover && radius && fitted === whole && boxCenter(json.box).some((at, axis) => axis < 2 && at !== local[axis as 0]);
  return centerCamera(fitted, rendering, add(json.origin, local), zoom ?? (isAside ? most : fitted.zoom));
}

/** Returns the world position under CSS pixels at the height of the lowest content; null in level views. */
export function findGround(camera: Camera, { json }: Rendering, point: Vec2): Vec3 | null {
  const [u, v] = uvFromScreen(camera, point);
  const d = depthAtHeight(camera.frame.axes, v, json.box[0][2]);
  return d === null ? null : add(json.origin, localFromUvd(camera.frame.axes, [u, v, d]));
}

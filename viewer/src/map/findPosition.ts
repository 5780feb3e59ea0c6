import { UsageError } from "../core/errors";
import { isVector, type AnyPosition } from "../core/position";
import { add, sub, type Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import type { Rendering } from "../geo/manifest";
import { worldPosition } from "../geo/position";
import type { ImageLayer } from "./imageLayer";
import type { ViewState } from "./layerContext";
import { VisibleDepths } from "./visibleDepths";

/** Number of tiles that are read for one position. */
const TILES = 8;
/** Largest step of the depth between pixels of one surface, in pixels. */
const MAX_STEP = 8;

/**
 * Finds the world coordinates of a position: of an object, the top centre of its box; on the ground, the highest surface that some view shows there, the
 * current one first, else the content's lowest height. @throws UsageError when there is no such object, or the scene's position on earth is unknown
 */
export async function findPosition(
  position: AnyPosition,
  layers: readonly ImageLayer[],
  viewState: ViewState,
  rendering: Rendering,
): Promise<Vec3> {
  if (isVector(position)) return position;
  if ("object" in position) return findTop(layers, position.object);
  const world = worldPosition(position, rendering);
  const frames =
    typeof position.height === "number" ? [] : [viewState.camera.frame, ...[...rendering.views.values()].map(({ frame }) => frame)];
  for (const frame of frames) {
    const z = await findSurface(layers, { ...viewState, camera: { ...viewState.camera, frame } }, sub(world, viewState.origin));
    if (z !== null) return [world[0], world[1], viewState.origin[2] + z];
  }
  return world;
}

/** Returns the local height of the highest surface at x and y that a view shows, to a pixel; null where that is hidden or missing. */
async function findSurface(layers: readonly ImageLayer[], view: ViewState, [x, y]: Vec3): Promise<number | null> {
  const { axes } = view.camera.frame;
  const [lowest, highest] = new VisibleDepths(layers, view).heights;
  const [low, high] = [uvdFromLocal(axes, [x, y, lowest]), uvdFromLocal(axes, [x, y, highest])];
  const { relief } = await VisibleDepths.fetch(
    layers,
    view,
    [
      [low[0] - 1, low[1] - 1],
      [high[0] + 1, high[1] + 1],
    ],
    TILES,
  );
  const z = findHeight(relief, x, y);
  return Number.isNaN(z) ? null : z;
}

/** @internal Returns the local height of the highest visible surface at x and y, to a pixel; null where it is hidden or missing, NaN where depths are not in memory. */
export function findHeight(relief: VisibleDepths, x: number, y: number): number | null {
  const { axes } = relief.camera.frame;
  const [lowest, highest] = relief.heights;
  const step = relief.pixel_m;
  let [before, known] = [Infinity, true];
  for (let z = highest + step; z >= lowest - step; z -= step) {
    const [u, v, d] = uvdFromLocal(axes, [x, y, z]);
    const above = relief.depthAt(u, v) - d;
    known &&= !Number.isNaN(above);
    // From above the surface to below it in one step: the surface is here; or it jumps, since something in front hides the point.
    if (above <= 0)
      return above > -MAX_STEP * step ? z + (before > above && before < Infinity ? (step * -above) / (before - above) : 0) : null;
    before = above;
  }
  return known ? null : NaN;
}

/** @throws UsageError when no layer has the object */
async function findTop(layers: readonly ImageLayer[], wanted: number | string): Promise<Vec3> {
  for (const layer of layers) {
    const [id] = typeof wanted === "number" ? [wanted] : await layer.findByName(wanted);
    const box = (await layer.object(id ?? 0))?.box;
    if (box && layer.rendering)
      return add(layer.rendering.json.origin, [(box[0][0] + box[1][0]) / 2, (box[0][1] + box[1][1]) / 2, box[1][2]]);
  }
  throw new UsageError(noObject(wanted));
}

/** Says that there is no object of a name or id. */
export const noObject = (wanted: number | string): string =>
  `no object has the ${typeof wanted === "number" ? "id" : "name"} ${JSON.stringify(wanted)}; search finds objects by a part of their name`;

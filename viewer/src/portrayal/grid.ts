import { add, boxCenter, corners, dot, sub, type Box3, type Vec3 } from "../core/vec";
import { computeAxes, localFromUvd, uvdFromLocal, viewId } from "../geo/axes";
import { DEEPEST_LEVEL, makeFrame, pixelM, type Frame, type Tile } from "../geo/frame";
import { UsageError, type View } from "../map3d";

/** Where the camera of a tile is, in world coordinates. */
export interface TileCamera {
  /** On the plane from which depths count. */
  readonly position: Vec3;
  readonly target: Vec3;
  readonly up: Vec3;
  /** Half the side of the image, metres. */
  readonly half_m: number;
  readonly far_m: number;
  readonly straightDown: boolean;
}

/** Distance of the plane of depths from everything, metres: content may be higher than the service says. */
const ROOM_M = 1000;
/** Growth of the box, for content that has been added. */
const GROWTH = 1.05;
/** Distance of the point of interest, metres. */
const TARGET_M = 1000;

/** Reads the id of a view: look-at angle (counter-clockwise from north) and pitch (below the horizon), degrees. @throws UsageError */
export function parseViewId(id: string): readonly [lookAt_deg: number, pitch_deg: number] {
  const [, a, p] = /^(\d{1,3}(?:\.\d+)?)-(\d{1,2}(?:\.\d+)?)$/.exec(id) ?? [];
  const [lookAt_deg, pitch_deg] = [Number(a), Number(p)];
  if (!(lookAt_deg < 360) || !(pitch_deg > 0 && pitch_deg <= 90))
    throw new UsageError(`view "${id}": expected a look-at angle from 0 to 360 and a pitch from 0 to 90, such as "45-22.5"`);
  return [lookAt_deg, pitch_deg];
}

/** Makes views whose square holds a local box from all directions: spec/pyramid.md §2. */
export function makeViews(
  box: Box3,
  ids: readonly string[],
  resolution_m: number,
  tilePx: number,
): { views: View[]; size_m: number; zmax: number } {
  const center = boxCenter(box);
  const half = sub(box[1], box[0]).map((side) => Math.max((side / 2) * GROWTH, 1)) as unknown as Vec3;
  const axes = ids.map((id) => ({ id: parseViewId(id), axes: computeAxes(...parseViewId(id)) }));
  const extent = Math.max(
    ...axes.flatMap(({ axes: { right, up } }) =>
      [right, up].map((axis) => 2 * axis.reduce((sum, part, k) => sum + Math.abs(part) * (half[k] as number), 0)),
    ),
  );
  const zmax = Math.max(0, Math.ceil(Math.log2(extent / (tilePx * resolution_m))));
  if (zmax > DEEPEST_LEVEL)
    throw new UsageError(
      `resolution_m ${String(resolution_m)}: the layer would have ${String(zmax)} levels, the limit is ${String(DEEPEST_LEVEL)}`,
    );
  const size_m = tilePx * resolution_m * 2 ** zmax;
  const views = axes.map(({ id: [look_at_deg, pitch_deg], axes: view }): View => {
    const [u, v, d] = uvdFromLocal(view, center);
    const frame = makeFrame(
      {
        id: viewId(look_at_deg, pitch_deg),
        look_at_deg,
        pitch_deg,
        u0_m: u - size_m / 2,
        v0_m: v + size_m / 2,
        d0_m: d - Math.hypot(...half) - ROOM_M,
      },
      size_m,
      tilePx,
      zmax,
    );
    return {
      id: frame.id,
      frame,
      occupancy: { has: (tile) => meetsBox(frame, tile, center, half) },
      archives: undefined,
      part_bytes: undefined,
      versionOf: () => 1,
    };
  });
  return { views, size_m, zmax };
}

/** Does a tile meet the projection of a box? Exact, by separating axes: the sides of the tile, and those of the projected box. */
export function meetsBox(frame: Frame, { z, x, y }: Tile, center: Vec3, half: Vec3): boolean {
  const count = 2 ** z;
  if (z < 0 || z > frame.zmax || x < 0 || y < 0 || x >= count || y >= count) return false;
  const { right, up } = frame.axes;
  const side = frame.size / count;
  const [u, v] = [frame.u0 + (x + 0.5) * side - dot(right, center), frame.v0 - (y + 0.5) * side - dot(up, center)];
  const edges = ([0, 1, 2] as const).map((k) => [right[k] * half[k], up[k] * half[k]] as const);
  const normals = [[1, 0] as const, [0, 1] as const, ...edges.map(([eu, ev]) => [-ev, eu] as const)];
  return normals.every(([nu, nv]) => {
    const reach = edges.reduce((sum, [eu, ev]) => sum + Math.abs(nu * eu + nv * ev), 0) + ((Math.abs(nu) + Math.abs(nv)) * side) / 2;
    return Math.abs(nu * u + nv * v) <= reach;
  });
}

/** Computes the camera of a tile. Its depths count from the frame's d0. @param box the content, local */
export function placeCamera(frame: Frame, tile: Tile, origin: Vec3, box: Box3): TileCamera {
  const side = pixelM(frame, tile.z) * frame.tilePx;
  const [u, v] = [frame.u0 + (tile.x + 0.5) * side, frame.v0 - (tile.y + 0.5) * side];
  const at = (d: number): Vec3 => add(origin, localFromUvd(frame.axes, [u, v, d]));
  const deepest = Math.max(...corners(box).map((corner) => dot(frame.axes.forward, corner)));
  return {
    position: at(frame.d0),
    target: at(frame.d0 + TARGET_M),
    up: frame.axes.up,
    half_m: side / 2,
    far_m: Math.ceil(deepest - frame.d0 + Math.hypot(...sub(box[1], box[0])) + ROOM_M),
    straightDown: frame.pitch_deg === 90,
  };
}

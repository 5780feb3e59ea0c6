import { add, clamp, sub, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { depthAtHeight, localFromUvd, uvdFromLocal } from "../geo/axes";
import { projectedBox } from "../geo/camera";
import { DEEPEST_LEVEL, childrenOf } from "../geo/frame";
import { UsageError, type LayerInfo, type Map3D, type Rendering, type Tile, type View } from "../map3d";

/** The part of a map to save. */
export interface AreaOptions {
  /** World coordinates. Default: the current view, from all directions. */
  bounds?: Box3;
  /** First and last level. Default: all. */
  levels?: readonly [number, number];
  /** Names of layers in the manifest. Default: all but "depth2" and "picture". */
  layers?: readonly string[];
  /** View ids. Default: all. */
  directions?: readonly string[];
  /** Save the attributes of the objects in the area, the search index and the columns that themes use. Default true. */
  objects?: boolean;
}

/** `AreaOptions` with all defaults filled in. */
export type FilledArea = Required<AreaOptions>;

/** [[least U, least V], [greatest U, greatest V]], metres. */
type UvRect = readonly [Vec2, Vec2];

/** Levels up to this one are saved completely, for overviews. */
const LAST_COMPLETE_LEVEL = 1;
const OPTIONAL_LAYERS = ["depth2", "picture"];

/** Fills in the defaults. @throws UsageError when the map is not ready, or for unknown layers and directions */
export async function resolveOptions(
  shown: Map3D,
  { bounds, levels, layers, directions, objects = true }: AreaOptions,
): Promise<FilledArea> {
  const renderings = shown.layers.flatMap(({ rendering }) => rendering ?? []);
  if (renderings.length === 0) throw new UsageError('the map is not ready; wait for its event "ready"');
  const known = {
    layers: unique(renderings.flatMap(({ json }) => json.layers.map(({ name }) => name))),
    directions: unique(renderings.flatMap(({ views }) => [...views.keys()])),
  };
  for (const [what, list] of [
    ["layers", layers],
    ["directions", directions],
  ] as const) {
    const unknown = list?.find((name) => !known[what].includes(name));
    if (unknown !== undefined) throw new UsageError(`unknown ${what.slice(0, -1)} "${unknown}"; the map has ${known[what].join(", ")}`);
  }
  const [least, greatest] = levels ?? [0, DEEPEST_LEVEL];
  if (!(least >= 0 && least <= greatest))
    throw new UsageError(`levels must be a range from 0 upwards, got ${String(least)} to ${String(greatest)}`);
  return {
    bounds: bounds ?? (await boundsInView(shown, renderings, directions ?? known.directions)),
    objects,
    directions: directions ?? known.directions,
    levels: [least, Math.min(greatest, Math.max(...renderings.map(({ json }) => json.zmax)))],
    layers: layers ?? known.layers.filter((name) => !OPTIONAL_LAYERS.includes(name)),
  };
}

/** Returns the box above the ground that is in view when each direction looks at the centre of the screen: at the surface there, or at the ground if it is not known. */
async function boundsInView(shown: Map3D, renderings: readonly Rendering[], directions: readonly string[]): Promise<Box3> {
  const {
    metresPerPixel: px_m,
    container: { clientWidth, clientHeight },
  } = shown;
  const middle = [clientWidth / 2, clientHeight / 2] as const;
  const centers = [shown.unproject(middle), (await shown.pick(middle)).position].filter((at) => at !== null);
  const found = renderings.flatMap(({ json: { origin, box }, views }) => {
    const bottom = box[0][2];
    const ground = [...views.values()]
      .filter(({ id }) => directions.includes(id))
      .flatMap(({ frame: { axes } }) =>
        centers.flatMap((center) => {
          const [u, v] = uvdFromLocal(axes, sub(center, origin));
          return (
            [
              [-1, -1],
              [-1, 1],
              [1, -1],
              [1, 1],
            ] as const
          ).flatMap(([x, y]) => {
            const at = [u + (x * clientWidth * px_m) / 2, v + (y * clientHeight * px_m) / 2] as const;
            const depth = depthAtHeight(axes, at[1], bottom);
            return depth === null ? [] : [localFromUvd(axes, [...at, depth])];
          });
        }),
      );
    // In horizontal views the visible ground is unlimited.
    const area: readonly Vec3[] = ground.length === 0 ? box : ground;
    return area.flatMap(([x, y]) => box.map(([, , z]) => add(origin, [x, y, z])));
  });
  const extreme = (of: (...parts: number[]) => number): Vec3 => [
    of(...found.map((at) => at[0])),
    of(...found.map((at) => at[1])),
    of(...found.map((at) => at[2])),
  ];
  return [extreme(Math.min), extreme(Math.max)];
}

/** A tile to save. */
export interface PlannedTile {
  readonly view: View;
  readonly layer: LayerInfo;
  readonly tile: Tile;
}

/** Yields all occupied tiles of a rendering in an area. */
export function* tilesOf(rendering: Rendering, { bounds, levels, layers, directions }: FilledArea): Generator<PlannedTile> {
  const {
    json: { origin, box, layers: infos },
    views,
  } = rendering;
  const local = bounds.map((corner) =>
    sub(corner, origin).map((part, k) => clamp(part, box[0][k] ?? 0, box[1][k] ?? 0)),
  ) as unknown as Box3;
  const outside = [0, 1].some(
    (k) => (bounds[1][k] ?? 0) - (origin[k] ?? 0) < (box[0][k] ?? 0) || (bounds[0][k] ?? 0) - (origin[k] ?? 0) > (box[1][k] ?? 0),
  );
  if (outside) return;
  for (const view of views.values()) {
    if (!directions.includes(view.id)) continue;
    const rect = projectedBox(view.frame, local);
    for (const tile of tilesIn(view, rect, levels)) for (const layer of infos) if (layers.includes(layer.name)) yield { view, layer, tile };
  }
}

/** Yields the occupied tiles that overlap a rectangle, and all of the first levels; each tile before its children. */
export function* tilesIn(
  { frame, occupancy }: Pick<View, "frame" | "occupancy">,
  [low, high]: UvRect,
  [least, greatest]: readonly [number, number],
  tile: Tile = { z: 0, x: 0, y: 0 },
): Generator<Tile> {
  if (tile.z > greatest || !occupancy.has(tile)) return;
  const tile_m = frame.size / 2 ** tile.z;
  const overlaps = (at: number, from: number, to: number): boolean => at >= Math.floor(from / tile_m) && at < Math.ceil(to / tile_m);
  if (
    tile.z > LAST_COMPLETE_LEVEL &&
    !(overlaps(tile.x, low[0] - frame.u0, high[0] - frame.u0) && overlaps(tile.y, frame.v0 - high[1], frame.v0 - low[1]))
  )
    return;
  if (tile.z >= least) yield tile;
  for (const child of childrenOf(tile)) yield* tilesIn({ frame, occupancy }, [low, high], [least, greatest], child);
}

const unique = (names: readonly string[]): string[] => [...new Set(names)];

import { add, clamp, sub, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { depthAtHeight, localFromUvd, uvdFromLocal } from "../geo/axes";
import { projectedBox } from "../geo/camera";
import { childrenOf } from "../geo/frame";
import { UsageError, type LayerInfo, type map, type Rendering, type Tile, type View } from "../map3d";

/** What of a map is kept; all can be left out. */
export interface AreaOptions {
  /** World coordinates, as of `fitBounds`. Default: what is in view, from all directions. */
  bounds?: Box3;
  /** First and last level. Default all. */
  levels?: readonly [number, number];
  /** Names of layers in the manifest. Default all but "depth2" and "picture". */
  layers?: readonly string[];
  /** View ids. Default all. */
  directions?: readonly string[];
  /** Names and attributes of objects in the area, the search index and what themes colour by. Default true. */
  objects?: boolean;
}

/** What of a map is kept, in full. */
export type FilledArea = Required<AreaOptions>;

/** [[least U, least V], [greatest U, greatest V]], metres. */
type Rect = readonly [Vec2, Vec2];

/** Levels that are kept whole, for an overview. */
const WHOLE_LEVEL = 1;
const SELDOM = ["depth2", "picture"];

/** Options with their defaults. @throws UsageError for a map that shows nothing yet, or what no rendering of it has */
export async function filled(shown: map, { bounds, levels, layers, directions, objects = true }: AreaOptions): Promise<FilledArea> {
  const renderings = shown.layers.flatMap(({ rendering }) => rendering ?? []);
  if (renderings.length === 0) throw new UsageError("the map shows nothing yet; wait for its event \"ready\"");
  const known = { layers: unique(renderings.flatMap(({ json }) => json.layers.map(({ name }) => name))), directions: unique(renderings.flatMap(({ views }) => [...views.keys()])) };
  for (const [what, list] of [["layers", layers], ["directions", directions]] as const) {
    const odd = list?.find((name) => !known[what].includes(name));
    if (odd !== undefined) throw new UsageError(`"${odd}" is none of the map's ${what}: ${known[what].join(", ")}`);
  }
  const [least, greatest] = levels ?? [0, 26];
  if (!(least >= 0 && least <= greatest)) throw new UsageError(`levels go from 0 upwards, got ${String(least)} to ${String(greatest)}`);
  return {
    bounds: bounds ?? await boundsInView(shown, renderings, directions ?? known.directions), objects, directions: directions ?? known.directions,
    levels: [least, Math.min(greatest, Math.max(...renderings.map(({ json }) => json.zmax)))],
    layers: layers ?? known.layers.filter((name) => !SELDOM.includes(name)),
  };
}

/** Upright over the ground that is in view when the map looks from each direction at what is in its middle: the surface there, or the ground while that is not known. */
async function boundsInView(shown: map, renderings: readonly Rendering[], directions: readonly string[]): Promise<Box3> {
  const { metresPerPixel: px_m, container: { clientWidth, clientHeight } } = shown;
  const middle = [clientWidth / 2, clientHeight / 2] as const;
  const centers = [shown.unproject(middle), (await shown.pick(middle)).position].filter((at) => at !== null);
  const found = renderings.flatMap(({ json: { origin, box }, views }) => {
    const bottom = box[0][2];
    const ground = [...views.values()].filter(({ id }) => directions.includes(id)).flatMap(({ frame: { axes } }) => centers.flatMap((center) => {
      const [u, v] = uvdFromLocal(axes, sub(center, origin));
      return ([[-1, -1], [-1, 1], [1, -1], [1, 1]] as const).flatMap(([x, y]) => {
        const at = [u + (x * clientWidth * px_m) / 2, v + (y * clientHeight * px_m) / 2] as const;
        const depth = depthAtHeight(axes, at[1], bottom);
        return depth === null ? [] : [localFromUvd(axes, [...at, depth])];
      });
    }));
    // In level views the ground has no end.
    const flat: readonly Vec3[] = ground.length === 0 ? box : ground;
    return flat.flatMap(([x, y]) => box.map(([, , z]) => add(origin, [x, y, z])));
  });
  const ends = (of: (...parts: number[]) => number): Vec3 => [of(...found.map((at) => at[0])), of(...found.map((at) => at[1])), of(...found.map((at) => at[2]))];
  return [ends(Math.min), ends(Math.max)];
}

/** A tile to be kept. */
export interface Wanted {
  readonly view: View;
  readonly layer: LayerInfo;
  readonly tile: Tile;
}

/** All tiles of a rendering that an area needs; empty ones are left out. */
export function* tilesOf(rendering: Rendering, { bounds, levels, layers, directions }: FilledArea): Generator<Wanted> {
  const { json: { origin, box, layers: infos }, views } = rendering;
  const local = bounds.map((corner) => sub(corner, origin).map((part, k) => clamp(part, box[0][k] ?? 0, box[1][k] ?? 0))) as unknown as Box3;
  const outside = [0, 1].some((k) => (bounds[1][k] ?? 0) - (origin[k] ?? 0) < (box[0][k] ?? 0) || (bounds[0][k] ?? 0) - (origin[k] ?? 0) > (box[1][k] ?? 0));
  if (outside) return;
  for (const view of views.values()) {
    if (!directions.includes(view.id)) continue;
    const rect = projectedBox(view.frame, local);
    for (const tile of tilesIn(view, rect, levels)) for (const layer of infos) if (layers.includes(layer.name)) yield { view, layer, tile };
  }
}

/** Occupied tiles that meet a rectangle, and those of the first levels, each before those below it. */
export function* tilesIn({ frame, occupancy }: Pick<View, "frame" | "occupancy">, [low, high]: Rect, [least, greatest]: readonly [number, number], tile: Tile = { z: 0, x: 0, y: 0 }): Generator<Tile> {
  if (tile.z > greatest || !occupancy.has(tile)) return;
  const tile_m = frame.size / 2 ** tile.z;
  const meets = (at: number, from: number, to: number): boolean => at >= Math.floor(from / tile_m) && at < Math.ceil(to / tile_m);
  if (tile.z > WHOLE_LEVEL && !(meets(tile.x, low[0] - frame.u0, high[0] - frame.u0) && meets(tile.y, frame.v0 - high[1], frame.v0 - low[1]))) return;
  if (tile.z >= least) yield tile;
  for (const child of childrenOf(tile)) yield* tilesIn({ frame, occupancy }, [low, high], [least, greatest], child);
}

const unique = (names: readonly string[]): string[] => [...new Set(names)];

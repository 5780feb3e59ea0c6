import { clamp, sub, type Box3, type Vec2 } from "../core/vec";
import { projectedBox } from "../geo/camera";
import { childrenOf } from "../geo/frame";
import { UsageError, type LayerInfo, type map, type Rendering, type Tile, type View } from "../map3d";

/** What of a map is kept; all can be left out. */
export interface AreaOptions {
  /** World coordinates, as of `fitBounds`. Default: the ground that is in view. */
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

export type FilledArea = Required<AreaOptions>;

/** [[least U, least V], [greatest U, greatest V]], metres. */
type Rect = readonly [Vec2, Vec2];

/** Levels that are kept whole, for an overview. */
const WHOLE_LEVEL = 1;
const SELDOM = ["depth2", "picture"];

/** Options with their defaults. @throws UsageError for a map that shows nothing yet, or what no rendering of it has */
export function filled(shown: map, { bounds, levels, layers, directions, objects = true }: AreaOptions): FilledArea {
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
    bounds: bounds ?? boundsInView(shown, renderings), objects, directions: directions ?? known.directions,
    levels: [least, Math.min(greatest, Math.max(...renderings.map(({ json }) => json.zmax)))],
    layers: layers ?? known.layers.filter((name) => !SELDOM.includes(name)),
  };
}

/** Upright over the ground that is in view. */
function boundsInView(shown: map, renderings: readonly Rendering[]): Box3 {
  const { clientWidth: width, clientHeight: height } = shown.container;
  const seen = ([[0, 0], [width, 0], [0, height], [width, height]] as const).map((point) => shown.unproject(point)).filter((at) => at !== null);
  const boxes = renderings.map(({ json: { origin, box } }) => box.map((corner) => corner.map((part, k) => part + (origin[k] ?? 0))));
  const ends = (k: number, of: (...parts: number[]) => number, corner: 0 | 1): number => {
    const whole = of(...boxes.map((box) => box[corner]?.[k] ?? 0));
    return k === 2 || seen.length === 0 ? whole : of(...seen.map((at) => at[k] ?? 0));
  };
  return [[ends(0, Math.min, 0), ends(1, Math.min, 0), ends(2, Math.min, 0)], [ends(0, Math.max, 1), ends(1, Math.max, 1), ends(2, Math.max, 1)]];
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

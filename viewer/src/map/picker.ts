import { add, type Vec2, type Vec3 } from "../core/vec";
import { localFromUvd } from "../geo/axes";
import { cssPixelM } from "../geo/camera";
import { pixelAt, uvOfPixel, type Tile } from "../geo/frame";
import type { LayerKind, View } from "../geo/manifest";
import { NO_DEPTH, type TileData } from "../tiles/tileData";
import type { imageLayer } from "./imageLayer";
import { middleIn } from "./layerPlan";
import type { Sight } from "./stage";

/** What lies under a pixel. */
export interface Pick {
  /** Object id; 0: nothing is there. */
  readonly id: number;
  /** World coordinates of the surface; null where nothing is, or its depth is not known (yet). */
  readonly position: Vec3 | null;
  /** true: read from a tile above the deepest level, so only about right. */
  readonly approximate: boolean;
  readonly layer: imageLayer | null;
}

export const NOTHING: Pick = { id: 0, position: null, approximate: false, layer: null };

/** What is exact: from the deepest level, whose tiles are fetched when they are not here. */
export async function pickExactly(layers: readonly imageLayer[], sight: Sight, at: Vec2): Promise<Pick> {
  for (const layer of [...layers].reverse()) {
    const spot = spotOf(layer, sight, at);
    if (!spot) continue;
    const zmax = spot.view.frame.zmax;
    const pixel = pixelAt(spot.view.frame, zmax, ...spot.uv);
    if (!pixel) continue;
    const [ids, depths] = await Promise.all([need(layer, spot.view, "id", pixel.tile), need(layer, spot.view, "depth", pixel.tile)]);
    const pick = read(layer, spot.view, pixel, ids, depths);
    if (pick) return pick;
  }
  return NOTHING;
}

/** What the tiles in memory tell, finest first; null when they tell nothing. */
export function pickLoaded(layers: readonly imageLayer[], sight: Sight, at: Vec2): Pick | null {
  let nothing: Pick | null = null;
  for (const layer of [...layers].reverse()) {
    const spot = spotOf(layer, sight, at);
    if (!spot) continue;
    for (let z = spot.view.frame.zmax; z >= 0; z--) {
      const pixel = pixelAt(spot.view.frame, z, ...spot.uv);
      if (!pixel) break;
      const ids = loaded(layer, spot.view, "id", pixel.tile);
      if (!ids) continue;
      const pick = read(layer, spot.view, pixel, ids, loaded(layer, spot.view, "depth", pixel.tile));
      if (pick) return pick;
      nothing = { ...NOTHING, approximate: z < spot.view.frame.zmax };
      break;
    }
  }
  return nothing;
}

interface Spot {
  readonly view: View;
  readonly uv: Vec2;
}

function spotOf(layer: imageLayer, sight: Sight, [x, y]: Vec2): Spot | null {
  const { camera } = sight;
  const view = layer.viewOf(camera.frame.id);
  if (!view || !layer.rendering) return null;
  const [u, v] = middleIn(view.frame, sight, layer.rendering);
  const px = cssPixelM(camera);
  return { view, uv: [u + (x - camera.width / 2) * px, v - (y - camera.height / 2) * px] };
}

async function need(layer: imageLayer, view: View, kind: LayerKind, tile: Tile): Promise<TileData | null> {
  const info = layer.rendering?.layers.get(kind);
  return info && layer.store ? layer.store.need(view, info, tile) : null;
}

function loaded(layer: imageLayer, view: View, kind: LayerKind, tile: Tile): TileData | null {
  const info = layer.rendering?.layers.get(kind);
  return (info && layer.store?.get(view, info, tile)?.data) ?? null;
}

interface Pixel {
  tile: Tile;
  i: number;
  j: number;
}

/** null when nothing is there. */
function read(layer: imageLayer, view: View, pixel: Pixel, ids: TileData | null, depths: TileData | null): Pick | null {
  const id = valueAt(ids, pixel);
  const depth = valueAt(depths, pixel) ?? NO_DEPTH;
  if ((!id && depth === NO_DEPTH) || layer.hides(id ?? 0)) return null;
  return { id: id ?? 0, position: positionOf(layer, view, pixel, depth), approximate: pixel.tile.z < view.frame.zmax, layer };
}

function valueAt(data: TileData | null, { i, j }: Pixel): number | undefined {
  return data?.kind === "id" || data?.kind === "depth" ? data.values[j * data.width + i] : undefined;
}

/** World coordinates of a pixel's centre. */
function positionOf(layer: imageLayer, { frame }: View, { tile, i, j }: Pixel, depth: number): Vec3 | null {
  const rendering = layer.rendering;
  if (!rendering || depth === NO_DEPTH) return null;
  const unit = rendering.layers.get("depth")?.unit_m ?? 2 ** -10;
  const [u, v] = uvOfPixel(frame, tile, i, j);
  return add(rendering.json.origin, localFromUvd(frame.axes, [u, v, frame.d0 + depth * unit]));
}

import { cssPixelM } from "../geo/camera";
import { findCover, computeLevel, computeViewRect } from "../tiles/cover";
import type { ImageLayer } from "./imageLayer";
import { computeCenter } from "./layerPlan";
import type { ViewState } from "./layerContext";

/** A visible object and its share of the screen. */
export interface VisibleObject {
  readonly id: number;
  /** Fraction of the screen that it covers. */
  readonly share: number;
}

/** Finds the visible objects of layers: those of the last layer first, the largest of each layer first. @param hidden includes objects that styles hide  @throws the error of a fetch */
export async function findAllVisibleObjects(
  layers: readonly ImageLayer[],
  viewState: ViewState,
  hidden: boolean,
): Promise<(VisibleObject & { readonly layer: ImageLayer })[]> {
  const found = await Promise.all(
    [...layers].reverse().map(async (layer) => (await findVisibleObjects(layer, viewState, hidden)).map((seen) => ({ ...seen, layer }))),
  );
  return found.flat();
}

/** Finds the visible objects of a layer, the largest first. Fetches the id tiles of the shown level. */
async function findVisibleObjects(layer: ImageLayer, viewState: ViewState, hidden: boolean): Promise<VisibleObject[]> {
  const { camera, dpr, finer } = viewState;
  const [view, info] = [layer.findView(camera.frame), layer.rendering?.layers.get("id")];
  const { rendering, tiles } = layer;
  if (!view || !rendering || !info || !tiles) return [];
  const { frame } = view;
  const px = cssPixelM(camera);
  const rect = computeViewRect(...computeCenter(frame, viewState, rendering), camera, px);
  const level = computeLevel(frame, px / dpr, dpr, finer);
  const pixel_m = frame.size / (frame.tilePx * 2 ** level);
  const counts = new Map<number, number>();
  const [[left, bottom], [right, top]] = rect;
  const cover = findCover(frame, (tile) => view.occupancy.has(tile), level, rect);
  for (const [tile, data] of await Promise.all(cover.map(async (tile) => [tile, await tiles.fetch(view, info, tile)] as const))) {
    if (data?.kind !== "id") continue;
    const [u, v] = [frame.u0 + tile.x * frame.tilePx * pixel_m, frame.v0 - tile.y * frame.tilePx * pixel_m];
    const inside = (from: number, to: number): [number, number] => [
      Math.max(0, Math.round(from / pixel_m)),
      Math.min(frame.tilePx, Math.round(to / pixel_m)),
    ];
    const [i0, i1] = inside(left - u, right - u);
    const [j0, j1] = inside(v - top, v - bottom);
    for (let j = j0; j < j1; j++) {
      for (let i = i0; i < i1; i++) {
        const id = data.values[j * data.width + i] as number;
        if (id !== 0 && (hidden || !layer.isHidden(id))) counts.set(id, (counts.get(id) ?? 0) + 1);
      }
    }
  }
  const pixelCount = ((right - left) * (top - bottom)) / pixel_m ** 2;
  return [...counts].map(([id, count]) => ({ id, share: count / pixelCount })).sort((a, b) => b.share - a.share || a.id - b.id);
}

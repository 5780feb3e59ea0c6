import type { Vec2, Vec3 } from "../core/vec";
import type { map } from "../map3d";

const NEAR_M = 0.5;

/**
 * The surface over a place on the ground plan, by halving heights: the line of sight through one that is too high passes over the surface and meets
 * something lower, or nothing; through one that is too low it meets something higher before. Where something stands before the place, the lowest that was met;
 * where nothing is, the lowest of all.
 */
export async function surfaceAt(map: map, [x, y]: Vec2): Promise<Vec3> {
  const [lowest, highest] = heightsOf(map);
  let [low, high, met] = [lowest, highest, Infinity];
  for (;;) {
    const z = (low + high) / 2;
    const point = map.project([x, y, z]);
    const hit = point && (await map.pick(point)).position;
    if (hit && Math.hypot(hit[0] - x, hit[1] - y) < NEAR_M) return [x, y, hit[2]];
    if (hit) met = Math.min(met, hit[2]);
    if (hit && hit[2] > z) low = z;
    else high = z;
    if (high - low < NEAR_M / 4) return [x, y, Number.isFinite(met) ? met : lowest];
  }
}

/** Least and greatest of all layers. */
function heightsOf(map: map): [number, number] {
  const boxes = map.layers.flatMap(({ rendering }) => (rendering ? [rendering.json] : []));
  return [Math.min(...boxes.map(({ origin, box }) => origin[2] + box[0][2])), Math.max(...boxes.map(({ origin, box }) => origin[2] + box[1][2]))];
}

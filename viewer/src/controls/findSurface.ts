import type { Vec2, Vec3 } from "../core/vec";
import type { Map3D } from "../map3d";

const TOLERANCE_M = 0.5;

/**
 * Finds the surface at a horizontal position by bisection over heights. The line of sight through a point above the surface hits something lower, or nothing;
 * through a point below the surface it hits something higher first. Returns the lowest height that was hit if the surface is hidden, and the scene's lowest
 * height if nothing was hit.
 */
export async function findSurface(map: Map3D, [x, y]: Vec2): Promise<Vec3> {
  const [lowest, highest] = heightRange(map);
  let [low, high, lowestHit] = [lowest, highest, Infinity];
  for (;;) {
    const z = (low + high) / 2;
    const point = map.project([x, y, z]);
    const hit = point && (await map.pick(point)).position;
    if (hit && Math.hypot(hit[0] - x, hit[1] - y) < TOLERANCE_M) return [x, y, hit[2]];
    if (hit) lowestHit = Math.min(lowestHit, hit[2]);
    if (hit && hit[2] > z) low = z;
    else high = z;
    if (high - low < TOLERANCE_M / 4) return [x, y, Number.isFinite(lowestHit) ? lowestHit : lowest];
  }
}

/** Lowest and highest height of all layers. */
function heightRange(map: Map3D): [number, number] {
  const boxes = map.layers.flatMap(({ rendering }) => (rendering ? [rendering.json] : []));
  return [
    Math.min(...boxes.map(({ origin, box }) => origin[2] + box[0][2])),
    Math.max(...boxes.map(({ origin, box }) => origin[2] + box[1][2])),
  ];
}

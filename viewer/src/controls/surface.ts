import type { Vec2, Vec3 } from "../core/vec";
import type { map } from "../map3d";

const TRIES = 8;
const NEAR_M = 0.5;

/**
 * The surface over a place on the ground plan: heights are tried until the line of sight through one meets the surface there. Where something
 * stands before it, the lowest that was met.
 */
export async function surfaceAt(map: map, [x, y]: Vec2): Promise<Vec3> {
  let z = lowest(map);
  const met: number[] = [];
  for (let k = 0; k < TRIES; k++) {
    const point = map.project([x, y, z]);
    const hit = point && (await map.pick(point)).position;
    if (!hit) break;
    met.push(hit[2]);
    if (Math.hypot(hit[0] - x, hit[1] - y) < NEAR_M) return [x, y, hit[2]];
    z = hit[2];
  }
  return [x, y, Math.min(...met, ...(met.length === 0 ? [lowest(map)] : []))];
}

const lowest = (map: map): number => Math.min(...map.layers.flatMap(({ rendering }) => (rendering ? [rendering.json.origin[2] + rendering.json.box[0][2]] : [])));

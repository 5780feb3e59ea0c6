import { add, sub, type Vec2, type Vec3 } from "../core/vec";
import { UsageError, type map } from "../map3d";
import type { Coordinate } from "./parse";

/** Degrees around the scene in which its polynomials count; beyond, places go straight on. */
const REACH_DEG = 0.5;
/** Farther from the scene nothing is drawn. */
const FARTHEST_M = 1e8;

/** Where a coordinate lies: metres from the scene's origin, height NaN where none is given; null for what is too far away. */
export type Placing = (coordinate: Coordinate) => Vec3 | null;

/** @param origin world  @throws UsageError when the scene does not say where on earth it lies */
export function placing(map: Pick<map, "lonLat" | "fromLonLat">, origin: Vec3, crs: "lonlat" | "scene"): Placing {
  if (crs === "scene") return (coordinate) => near(sub(coordinate, origin));
  const [middle, start] = [map.lonLat(origin), map.lonLat(origin) && map.fromLonLat(map.lonLat(origin) as Vec2)];
  if (!middle || !start) throw new UsageError('this rendering does not say where on earth it lies, so longitudes and latitudes have no place in it; give coordinates of the scene with crs: "scene"');
  return ([lon, lat, z]) => {
    const [east, north] = [((((lon - middle[0] + 180) % 360) + 360) % 360) - 180, lat - middle[1]];
    const times = Math.max(Math.hypot(east, north) / REACH_DEG, 1);
    const at = map.fromLonLat([middle[0] + east / times, middle[1] + north / times]);
    return at && near([start[0] + (at[0] - start[0]) * times - origin[0], start[1] + (at[1] - start[1]) * times - origin[1], z - origin[2]]);
  };
}

function near(local: Vec3): Vec3 | null {
  const far = Math.max(Math.abs(local[0]), Math.abs(local[1]), Math.abs(local[2] || 0));
  return far < FARTHEST_M ? local : null;
}

/** World position of a local one; on the given height where it has none. */
export const worldOf = (origin: Vec3, [x, y, z]: Vec3, height: number): Vec3 => add(origin, [x, y, Number.isNaN(z) ? height : z]);

import { add, sub, type Vec2, type Vec3 } from "../core/vec";
import { UsageError, type Map3D } from "../map3d";
import type { Coordinate } from "./parse";

/** Range of the scene's coordinate polynomials in degrees; beyond it, positions are extrapolated linearly. */
const REACH_DEG = 0.5;
/** Features farther from the scene are not drawn. */
const MAX_DISTANCE_M = 1e8;

/** Converts a coordinate to metres from the scene's origin (height NaN when missing); null when it is too far away. */
export type CoordinateTransform = (coordinate: Coordinate) => Vec3 | null;

/** Creates the transform to local coordinates. @param origin world  @throws UsageError when the rendering has no geographic coordinates */
export function coordinateTransform(map: Pick<Map3D, "lonLat" | "fromLonLat">, origin: Vec3, crs: "lonlat" | "scene"): CoordinateTransform {
  if (crs === "scene") return (coordinate) => ifNear(sub(coordinate, origin));
  const [middle, start] = [map.lonLat(origin), map.lonLat(origin) && map.fromLonLat(map.lonLat(origin) as Vec2)];
  if (!middle || !start)
    throw new UsageError(
      'this rendering has no geographic coordinates, so longitudes and latitudes cannot be placed; use coordinates of the scene with crs: "scene"',
    );
  return ([lon, lat, z]) => {
    const [east, north] = [((((lon - middle[0] + 180) % 360) + 360) % 360) - 180, lat - middle[1]];
    const times = Math.max(Math.hypot(east, north) / REACH_DEG, 1);
    const at = map.fromLonLat([middle[0] + east / times, middle[1] + north / times]);
    return (
      at && ifNear([start[0] + (at[0] - start[0]) * times - origin[0], start[1] + (at[1] - start[1]) * times - origin[1], z - origin[2]])
    );
  };
}

function ifNear(local: Vec3): Vec3 | null {
  const far = Math.max(Math.abs(local[0]), Math.abs(local[1]), Math.abs(local[2] || 0));
  return far < MAX_DISTANCE_M ? local : null;
}

/** Returns the world position of a local one. @param height used when the position has none */
export const worldOf = (origin: Vec3, [x, y, z]: Vec3, height: number): Vec3 => add(origin, [x, y, Number.isNaN(z) ? height : z]);

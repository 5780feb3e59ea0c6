import { UsageError } from "../core/errors";
import { isVector, type Position } from "../core/position";
import { sub, type Vec2, type Vec3 } from "../core/vec";
import { localFromLonLat, lonLatFromLocal } from "./geographic";
import type { Rendering } from "./manifest";

type Georeference = Pick<Rendering["json"], "geographic" | "origin">;

/** Returns world coordinates; on the ground, those of the content's lowest point. @throws UsageError for longitude and latitude where the scene's position on earth is unknown */
export function worldPosition(position: Position, { json }: Pick<Rendering, "json">): Vec3 {
  if (isVector(position)) return position;
  const { lonLat, xy, height } = position;
  const z = typeof height === "number" ? height : json.origin[2] + json.box[0][2];
  if (!lonLat) return [...(xy as Vec2), z];
  const world = worldFromLonLat(json, lonLat);
  if (!world) throw new UsageError(`cannot locate rendering "${json.name}" on earth; use [x, y, z] instead of lonLat`);
  return [...world, z];
}

/** Converts a world position to longitude and latitude (WGS 84, degrees); null where the scene's position on earth is unknown. */
export function lonLatFromWorld({ geographic, origin }: Georeference, world: Vec3): Vec2 | null {
  return geographic ? lonLatFromLocal(geographic, sub(world, origin)) : null;
}

/** Converts longitude and latitude to world x and y; null where the scene's position on earth is unknown. */
export function worldFromLonLat({ geographic, origin }: Georeference, lonLat: Vec2): Vec2 | null {
  if (!geographic) return null;
  const [x, y] = localFromLonLat(geographic, lonLat);
  return [origin[0] + x, origin[1] + y];
}

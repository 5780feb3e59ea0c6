import { UsageError } from "../core/errors";
import { isVector, type Position } from "../core/position";
import type { Vec2, Vec3 } from "../core/vec";
import { localFromLonLat } from "./geographic";
import type { Rendering } from "./manifest";

/** Returns world coordinates; on the ground, those of the content's lowest point. @throws UsageError for longitude and latitude where the scene's position on earth is unknown */
export function worldPosition(position: Position, { json }: Pick<Rendering, "json">): Vec3 {
  if (isVector(position)) return position;
  const { lonLat, xy, height } = position;
  const z = typeof height === "number" ? height : json.origin[2] + json.box[0][2];
  if (!lonLat) return [...(xy as Vec2), z];
  if (!json.geographic) throw new UsageError(`cannot locate rendering "${json.name}" on earth; use [x, y, z] instead of lonLat`);
  const [x, y] = localFromLonLat(json.geographic, lonLat);
  return [json.origin[0] + x, json.origin[1] + y, z];
}

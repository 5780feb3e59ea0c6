import { checkVector } from "./check";
import type { Vec2, Vec3 } from "./vec";

/** A position given by its longitude and latitude (WGS 84, degrees), or by x and y of the scene's CRS. */
export interface GroundPosition {
  /** Longitude and latitude. */
  readonly lonLat?: Vec2;
  /** Instead of `lonLat`: x and y, metres. */
  readonly xy?: Vec2;
  /** Height in the scene's CRS, metres; "ground": that of the highest visible surface. Default "ground". */
  readonly height?: number | "ground";
}

/** A position: `[x, y, z]` in the scene's CRS, metres; `{ lonLat: [longitude, latitude] }`; or `{ xy: [x, y] }`. */
export type Position = Vec3 | GroundPosition;

/** The top of an object, by its id, its name (such as a gml:id) or its label. */
export interface ObjectPosition {
  readonly object: number | string;
}

/** A position, or that of an object. */
export type AnyPosition = Position | ObjectPosition;

export const isVector = (position: AnyPosition): position is Vec3 => Array.isArray(position);

/** Checks a position. @throws UsageError that says what it can be */
export function checkPosition<P extends AnyPosition>(position: P, name: string): P {
  const { lonLat, xy, height = "ground", object } = { ...(position as GroundPosition & ObjectPosition) };
  if (typeof object === "string" || typeof object === "number") return position;
  const flat = lonLat ?? xy;
  if (!flat) checkVector(position as Vec3, name);
  else checkVector(flat, name, lonLat ? "lonLat: [longitude, latitude] in degrees" : "xy: [x, y], metres in the scene's CRS", 2);
  if (flat && height !== "ground") checkVector([height], name, 'height: metres, or "ground"', 1);
  return position;
}

/** x and y: metres in the scene's CRS, or CSS pixels on the map with y down. */
export type Vec2 = readonly [number, number];
/** x, y and z: east, north and up, metres in the scene's CRS (world) or from its origin (local). */
export type Vec3 = readonly [number, number, number];
/** Minimum and maximum corner. */
export type Box3 = readonly [Vec3, Vec3];

export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const add = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const boxCenter = ([lo, hi]: Box3): Vec3 => [(lo[0] + hi[0]) / 2, (lo[1] + hi[1]) / 2, (lo[2] + hi[2]) / 2];
export const clamp = (value: number, low: number, high: number): number => Math.min(Math.max(value, low), high);

export function corners([lo, hi]: Box3): Vec3[] {
  const points: Vec3[] = [];
  for (const x of [lo[0], hi[0]]) for (const y of [lo[1], hi[1]]) for (const z of [lo[2], hi[2]]) points.push([x, y, z]);
  return points;
}

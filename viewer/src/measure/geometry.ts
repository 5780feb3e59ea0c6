import { add, dot, sub, type Vec3 } from "../core/vec";

/** Measurements of a line; metres. */
export interface LineMeasure {
  /** Length in 3D. */
  readonly length_m: number;
  /** Length seen from above. */
  readonly horizontal_m: number;
  /** Height difference from the first point to the last; negative downwards. */
  readonly rise_m: number;
  /** Length of each segment. */
  readonly steps_m: readonly number[];
}

/** Measurements of a polygon in 3D. */
export interface AreaMeasure {
  /** Area seen along the normal. */
  readonly area_m2: number;
  /** Area seen from above. */
  readonly footprint_m2: number;
  readonly perimeter_m: number;
  /** Unit normal, never downwards; zeros for a polygon without area. */
  readonly normal: Vec3;
  /** Angle to the horizontal: 0 for a floor, 90 for a wall. */
  readonly slope_deg: number;
  /** Greatest distance of a corner from the mean plane. */
  readonly unevenness_m: number;
}

/** Measures a line through points; zeros for fewer than two points. */
export function measureLine(points: readonly Vec3[]): LineMeasure {
  const steps = points.slice(1).map((point, k) => sub(point, points[k] as Vec3));
  const steps_m = steps.map((step) => Math.hypot(...step));
  const [first, last] = [points[0], points.at(-1)];
  return {
    length_m: total(steps_m),
    horizontal_m: total(steps.map(([x, y]) => Math.hypot(x, y))),
    rise_m: first && last ? last[2] - first[2] : 0,
    steps_m,
  };
}

/** Measures a polygon by Newell's method, which accepts corners that are not exactly coplanar. */
export function measureArea(points: readonly Vec3[]): AreaMeasure {
  const closed = points.length > 0 ? [...points, points[0] as Vec3] : [];
  const perimeter_m = total(measureLine(closed).steps_m);
  // Relative to the first corner, since large world coordinates lose precision.
  const local = points.map((point) => sub(point, points[0] as Vec3));
  const doubled = local.reduce<Vec3>((sum, point, k) => add(sum, cross(point, local[(k + 1) % local.length] as Vec3)), [0, 0, 0]);
  const length = Math.hypot(...doubled);
  if (length < 1e-9) return { area_m2: 0, footprint_m2: 0, perimeter_m, normal: [0, 0, 0], slope_deg: 0, unevenness_m: 0 };
  const sign = doubled[2] < 0 ? -1 : 1;
  const normal = doubled.map((part) => (sign * part) / length) as unknown as Vec3;
  const heights = local.map((point) => dot(point, normal));
  const middle = total(heights) / heights.length;
  return {
    area_m2: length / 2,
    footprint_m2: Math.abs(doubled[2]) / 2,
    perimeter_m,
    normal,
    slope_deg: (Math.acos(Math.min(Math.abs(normal[2]), 1)) * 180) / Math.PI,
    unevenness_m: Math.max(...heights.map((height) => Math.abs(height - middle))),
  };
}

const total = (values: readonly number[]): number => values.reduce((sum, value) => sum + value, 0);

const cross = (a: Vec3, b: Vec3): Vec3 => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

import { add, dot, sub, type Vec3 } from "../core/vec";

/** Of a line over points of a surface; metres. */
export interface LineMeasure {
  readonly length_m: number;
  /** The same seen from above. */
  readonly horizontal_m: number;
  /** From the first point to the last; negative downwards. */
  readonly rise_m: number;
  /** Lengths from point to point. */
  readonly steps_m: readonly number[];
}

/** Of a polygon in space. */
export interface AreaMeasure {
  /** Of the polygon seen along its normal. */
  readonly area_m2: number;
  /** Seen from above. */
  readonly footprint_m2: number;
  readonly perimeter_m: number;
  /** Unit, upwards or sideways; zeros where the polygon has no area. */
  readonly normal: Vec3;
  /** Of the surface against the horizontal: 0 a floor, 90 a wall. */
  readonly slope_deg: number;
  /** Greatest distance of a corner from the plane through the middle. */
  readonly unevenness_m: number;
}

/** Of a line from point to point; zeros for less than two. */
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

/** By Newell's sum over the edges, which takes corners that do not quite lie in a plane. */
export function measureArea(points: readonly Vec3[]): AreaMeasure {
  const closed = points.length > 0 ? [...points, points[0] as Vec3] : [];
  const perimeter_m = total(measureLine(closed).steps_m);
  // About one of the corners, so that large world coordinates leave no noise.
  const own = points.map((point) => sub(point, points[0] as Vec3));
  const doubled = own.reduce<Vec3>((sum, point, k) => add(sum, cross(point, own[(k + 1) % own.length] as Vec3)), [0, 0, 0]);
  const length = Math.hypot(...doubled);
  if (length < 1e-9) return { area_m2: 0, footprint_m2: 0, perimeter_m, normal: [0, 0, 0], slope_deg: 0, unevenness_m: 0 };
  const sign = doubled[2] < 0 ? -1 : 1;
  const normal = doubled.map((part) => (sign * part) / length) as unknown as Vec3;
  const heights = own.map((point) => dot(point, normal));
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

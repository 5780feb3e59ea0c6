import { UsageError, type Vec2, type Vec3 } from "../map3d";
import { properName, type Label } from "./label";

/** A feature as far as labels read it. */
export interface LabelledFeature {
  readonly geometry?: {
    readonly type?: string;
    readonly coordinates?: unknown;
    readonly geometries?: readonly LabelledFeature["geometry"][];
  } | null;
  readonly properties?: Readonly<Record<string, unknown>> | null;
}

type FeatureCoordinate = readonly [number, number, number?];
type Transform = (lonLat: Vec2) => Vec2 | null;

/** Makes a label of each feature that has a name: at a point, in the middle of a line, in the middle of a polygon. Larger features come first. @throws UsageError for anything but GeoJSON */
export function labelFeatures(data: unknown, name: (feature: LabelledFeature) => string, toWorld: Transform): Label[] {
  const { type, features } = (data ?? {}) as { type?: string; features?: LabelledFeature[] };
  if (type !== "FeatureCollection" || !Array.isArray(features))
    throw new UsageError(
      `labels: expected an image layer, a URL or a FeatureCollection of GeoJSON, got ${type === undefined ? typeof data : `type "${type}"`}`,
    );
  return features.flatMap((feature) => {
    const text = name(feature);
    const place = text === "" ? null : findPlace(feature.geometry);
    const [first, ...more] = (place?.at ?? []).flatMap(([lon, lat, height]): Vec3[] => {
      const at = toWorld([lon, lat]);
      return at ? [[at[0], at[1], height ?? NaN]] : [];
    });
    return place && first ? [{ text, positions: [first, ...more], rank: place.size, line: place.line }] : [];
  });
}

export const nameOf = ({ properties }: LabelledFeature): string => properName(properties?.["name"]);

interface Place {
  readonly at: readonly FeatureCoordinate[];
  /** Extent in degrees. */
  readonly size: number;
  readonly line: boolean;
}

function findPlace(geometry: LabelledFeature["geometry"]): Place | null {
  const { type = "", coordinates } = geometry ?? {};
  const list = (Array.isArray(coordinates) ? coordinates : []) as unknown[];
  const parts = type.startsWith("Multi") ? list : [list];
  const lines = parts
    .map((part) => (type.endsWith("Point") ? [part] : type.endsWith("Polygon") ? (part as unknown[])[0] : part) as FeatureCoordinate[])
    .filter((line) => Array.isArray(line) && line.length > 0 && line.every(isCoordinate));
  const largest = [...lines].sort((a, b) => extent(b) - extent(a))[0];
  if (!largest || !/(Point|LineString|Polygon)$/.test(type)) return null;
  const line = type.endsWith("LineString");
  return {
    at: type.endsWith("Polygon") ? [centroid(largest)] : (line ? ALONG : [0]).map((share) => pointAt(largest, share)),
    size: extent(largest),
    line,
  };
}

const isCoordinate = (value: unknown): boolean => Array.isArray(value) && Number.isFinite(value[0]) && Number.isFinite(value[1]);

function extent(line: readonly FeatureCoordinate[]): number {
  const side = (axis: 0 | 1): number => Math.max(...line.map((point) => point[axis])) - Math.min(...line.map((point) => point[axis]));
  return Math.hypot(side(0), side(1));
}

/** Where the name of a line can stand, as shares of its length. */
const ALONG = [0.5, 0.35, 0.65, 0.2, 0.8];

/** Returns the point at a share of the length of a line. */
function pointAt(line: readonly FeatureCoordinate[], share: number): FeatureCoordinate {
  const steps = line
    .slice(1)
    .map((point, k) => Math.hypot(point[0] - (line[k] as FeatureCoordinate)[0], point[1] - (line[k] as FeatureCoordinate)[1]));
  let left = steps.reduce((sum, step) => sum + step, 0) * share;
  for (const [k, step] of steps.entries()) {
    const [from, to] = [line[k] as FeatureCoordinate, line[k + 1] as FeatureCoordinate];
    if (step > 0 && left <= step) return [from[0] + ((to[0] - from[0]) * left) / step, from[1] + ((to[1] - from[1]) * left) / step];
    left -= step;
  }
  return line[0] as FeatureCoordinate;
}

/** Returns the centre of gravity of a ring; that of its corners if it has no area. */
function centroid(ring: readonly FeatureCoordinate[]): FeatureCoordinate {
  const [x0, y0] = ring[0] as FeatureCoordinate;
  let [area, x, y] = [0, 0, 0];
  ring.forEach((point, k) => {
    const next = ring[(k + 1) % ring.length] as FeatureCoordinate;
    const [ax, ay, bx, by] = [point[0] - x0, point[1] - y0, next[0] - x0, next[1] - y0];
    const cross = ax * by - bx * ay;
    area += cross;
    x += (ax + bx) * cross;
    y += (ay + by) * cross;
  });
  return Math.abs(area) > 1e-18 ? [x0 + x / (3 * area), y0 + y / (3 * area)] : (ring[0] as FeatureCoordinate);
}

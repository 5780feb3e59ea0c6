import { UsageError } from "../map3d";

/** Longitude and latitude (degrees) or x and y (metres), and height (metres; NaN when missing). */
export type Coordinate = readonly [number, number, number];

/** A feature of RFC 7946, as given. Its members are untrusted: show them as text. */
export interface Feature {
  readonly type: "Feature";
  readonly id?: string | number;
  readonly geometry: unknown;
  readonly properties: Readonly<Record<string, unknown>> | null;
  readonly [member: string]: unknown;
}

/** A feature's geometry, with nested collections flattened. */
export interface FeatureShape {
  readonly feature: Feature;
  readonly points: readonly Coordinate[];
  readonly lines: readonly (readonly Coordinate[])[];
  /** Rings, the outer one first, without the point that closes them. */
  readonly polygons: readonly (readonly (readonly Coordinate[])[])[];
}

/** Skipped features and geometries: counts by reason. */
export type Skipped = ReadonlyMap<string, number>;

/** Deepest nesting of geometry collections. */
const MAX_NESTING = 16;

interface GeometryCollector {
  readonly points: Coordinate[];
  readonly lines: Coordinate[][];
  readonly polygons: Coordinate[][][];
  readonly skip: (reason: string) => void;
  readonly valid: (position: Coordinate) => boolean;
}

/** Reads a FeatureCollection, Feature or geometry. Skips and counts invalid geometries. @param geographic coordinates are longitudes and latitudes  @throws UsageError when the data is not GeoJSON */
export function readGeojson(data: unknown, geographic: boolean): { shapes: FeatureShape[]; skipped: Skipped } {
  const skipped = new Map<string, number>();
  const skip = (reason: string): unknown => skipped.set(reason, (skipped.get(reason) ?? 0) + 1);
  const valid = geographic ? onEarth : (): boolean => true;
  const shapes = featuresOf(data, skip).flatMap((feature) => {
    const collector: GeometryCollector = { points: [], lines: [], polygons: [], skip, valid };
    if (feature.geometry !== null && feature.geometry !== undefined) collect(feature.geometry, collector, 0);
    const { points, lines, polygons } = collector;
    return points.length + lines.length + polygons.length > 0 ? [{ feature, points, lines, polygons }] : [];
  });
  return { shapes, skipped };
}

const isObject = (value: unknown): value is Record<string, unknown> => typeof value === "object" && value !== null && !Array.isArray(value);

const GEOMETRIES = ["Point", "MultiPoint", "LineString", "MultiLineString", "Polygon", "MultiPolygon", "GeometryCollection"];

function featuresOf(data: unknown, skip: GeometryCollector["skip"]): Feature[] {
  if (!isObject(data)) throw new UsageError(`GeoJSON must be an object with a type, got ${data === null ? "null" : typeof data}`);
  const type = String(data["type"]);
  if (GEOMETRIES.includes(type)) return [{ type: "Feature", geometry: data, properties: null }];
  if (type === "Feature") return [featureOf(data)];
  const features = data["features"];
  if (type !== "FeatureCollection" || !Array.isArray(features))
    throw new UsageError(`GeoJSON must be a FeatureCollection with features, a Feature or a geometry, got type "${type.slice(0, 40)}"`);
  return features.flatMap((feature: unknown) => {
    if (isObject(feature) && feature["type"] === "Feature") return [featureOf(feature)];
    skip("not a feature");
    return [];
  });
}

/** Returns the feature as given; invalid properties become null. */
const featureOf = (data: Record<string, unknown>): Feature =>
  (isObject(data["properties"]) ? data : { ...data, properties: null }) as unknown as Feature;

function collect(geometry: unknown, collector: GeometryCollector, depth: number): void {
  const { type, coordinates, geometries } = isObject(geometry) ? geometry : {};
  if (type === "GeometryCollection" && Array.isArray(geometries)) {
    if (depth >= MAX_NESTING) collector.skip("geometry collections nested too deeply");
    else for (const part of geometries as unknown[]) collect(part, collector, depth + 1);
    return;
  }
  const many = typeof type === "string" && type.startsWith("Multi");
  const parts: readonly unknown[] = many ? (Array.isArray(coordinates) ? coordinates : [null]) : [coordinates];
  const kind = many ? type.slice(5) : type;
  for (const part of parts) {
    if (kind === "Point") keep(positionOf(part, collector), collector.points, "a point without a valid position", collector);
    else if (kind === "LineString") keep(lineOf(part, collector, 2), collector.lines, "a line without two valid positions", collector);
    else if (kind === "Polygon") keep(polygonOf(part, collector), collector.polygons, "a polygon with an invalid ring", collector);
    else {
      collector.skip("a geometry of unknown type");
      return;
    }
  }
}

function keep<T>(part: T | null, to: T[], reason: string, { skip }: GeometryCollector): void {
  if (part === null) skip(reason);
  else to.push(part);
}

const onEarth = ([lon, lat]: Coordinate): boolean => Math.abs(lon) <= 540 && Math.abs(lat) <= 90;

function positionOf(value: unknown, { valid }: GeometryCollector): Coordinate | null {
  if (!Array.isArray(value)) return null;
  const [x, y, z] = value as unknown[];
  if (typeof x !== "number" || typeof y !== "number" || !Number.isFinite(x) || !Number.isFinite(y)) return null;
  if (z !== undefined && (typeof z !== "number" || !Number.isFinite(z))) return null;
  const position = [x, y, z ?? NaN] as const;
  return valid(position) ? position : null;
}

function lineOf(value: unknown, collector: GeometryCollector, minimum: number): Coordinate[] | null {
  if (!Array.isArray(value) || value.length < minimum) return null;
  const line: Coordinate[] = [];
  for (const part of value as unknown[]) {
    const position = positionOf(part, collector);
    if (!position) return null;
    line.push(position);
  }
  return line;
}

function polygonOf(value: unknown, collector: GeometryCollector): Coordinate[][] | null {
  if (!Array.isArray(value) || value.length === 0) return null;
  const rings: Coordinate[][] = [];
  for (const part of value as unknown[]) {
    const ring = lineOf(part, collector, 3);
    const [first, last] = [ring?.[0], ring?.at(-1)];
    if (ring && first && last && first[0] === last[0] && first[1] === last[1] && (first[2] === last[2] || Number.isNaN(first[2])))
      ring.pop();
    if (!ring || ring.length < 3) return null;
    rings.push(ring);
  }
  return rings;
}

import { UsageError } from "../map3d";

/** Longitude and latitude (degrees), or x and y (metres); height, NaN where none is given. */
export type Coordinate = readonly [number, number, number];

/** A feature of RFC 7946, as given. Its members are data of others: show them as text. */
export interface Feature {
  readonly type: "Feature";
  readonly id?: string | number;
  readonly geometry: unknown;
  readonly properties: Readonly<Record<string, unknown>> | null;
  readonly [member: string]: unknown;
}

/** A feature's geometry, whatever collections it was given in. */
export interface Shape {
  readonly feature: Feature;
  readonly points: readonly Coordinate[];
  readonly lines: readonly (readonly Coordinate[])[];
  /** Rings, the outer one first, without the point that closes them. */
  readonly polygons: readonly (readonly (readonly Coordinate[])[])[];
}

/** What could not be read: reasons with their counts. */
export type Skipped = ReadonlyMap<string, number>;

/** Collections in collections. */
const DEEPEST = 16;

interface Found {
  readonly points: Coordinate[];
  readonly lines: Coordinate[][];
  readonly polygons: Coordinate[][][];
  readonly skip: (why: string) => void;
  readonly valid: (position: Coordinate) => boolean;
}

/** Reads a FeatureCollection, Feature or geometry. What is no geometry is skipped and counted. @param geographic coordinates are longitudes and latitudes  @throws UsageError for what is no GeoJSON at all */
export function readGeojson(data: unknown, geographic: boolean): { shapes: Shape[]; skipped: Skipped } {
  const skipped = new Map<string, number>();
  const skip = (why: string): void => { skipped.set(why, (skipped.get(why) ?? 0) + 1); };
  const valid = geographic ? onEarth : (): boolean => true;
  const shapes = featuresOf(data, skip).flatMap((feature) => {
    const found: Found = { points: [], lines: [], polygons: [], skip, valid };
    if (feature.geometry !== null && feature.geometry !== undefined) collect(feature.geometry, found, 0);
    const { points, lines, polygons } = found;
    return points.length + lines.length + polygons.length > 0 ? [{ feature, points, lines, polygons }] : [];
  });
  return { shapes, skipped };
}

const isObject = (value: unknown): value is Record<string, unknown> => typeof value === "object" && value !== null && !Array.isArray(value);

const GEOMETRIES = ["Point", "MultiPoint", "LineString", "MultiLineString", "Polygon", "MultiPolygon", "GeometryCollection"];

function featuresOf(data: unknown, skip: Found["skip"]): Feature[] {
  if (!isObject(data)) throw new UsageError(`GeoJSON is an object with a type, got ${data === null ? "null" : typeof data}`);
  const type = String(data["type"]);
  if (GEOMETRIES.includes(type)) return [{ type: "Feature", geometry: data, properties: null }];
  if (type === "Feature") return [featureOf(data)];
  const features = data["features"];
  if (type !== "FeatureCollection" || !Array.isArray(features)) throw new UsageError(`GeoJSON is a FeatureCollection with features, a Feature or a geometry, got type "${type.slice(0, 40)}"`);
  return features.flatMap((feature: unknown) => {
    if (isObject(feature) && feature["type"] === "Feature") return [featureOf(feature)];
    skip("not a feature");
    return [];
  });
}

/** The feature as it was given, but for properties that are none. */
const featureOf = (data: Record<string, unknown>): Feature => (isObject(data["properties"]) ? data : { ...data, properties: null }) as unknown as Feature;

function collect(geometry: unknown, found: Found, depth: number): void {
  const { type, coordinates, geometries } = isObject(geometry) ? geometry : {};
  if (type === "GeometryCollection" && Array.isArray(geometries)) {
    if (depth >= DEEPEST) found.skip("collections in collections, too many");
    else for (const part of geometries as unknown[]) collect(part, found, depth + 1);
    return;
  }
  const many = typeof type === "string" && type.startsWith("Multi");
  const parts: readonly unknown[] = many ? (Array.isArray(coordinates) ? coordinates : [null]) : [coordinates];
  const kind = many ? type.slice(5) : type;
  for (const part of parts) {
    if (kind === "Point") keep(positionOf(part, found), found.points, "a point without a valid position", found);
    else if (kind === "LineString") keep(lineOf(part, found, 2), found.lines, "a line without two valid positions", found);
    else if (kind === "Polygon") keep(polygonOf(part, found), found.polygons, "a polygon with a ring that is none", found);
    else {
      found.skip("a geometry of unknown type");
      return;
    }
  }
}

function keep<T>(part: T | null, to: T[], why: string, { skip }: Found): void {
  if (part === null) skip(why);
  else to.push(part);
}

const onEarth = ([lon, lat]: Coordinate): boolean => Math.abs(lon) <= 540 && Math.abs(lat) <= 90;

function positionOf(value: unknown, { valid }: Found): Coordinate | null {
  if (!Array.isArray(value)) return null;
  const [x, y, z] = value as unknown[];
  if (typeof x !== "number" || typeof y !== "number" || !Number.isFinite(x) || !Number.isFinite(y)) return null;
  if (z !== undefined && (typeof z !== "number" || !Number.isFinite(z))) return null;
  const position = [x, y, z ?? NaN] as const;
  return valid(position) ? position : null;
}

function lineOf(value: unknown, found: Found, least: number): Coordinate[] | null {
  if (!Array.isArray(value) || value.length < least) return null;
  const line: Coordinate[] = [];
  for (const part of value as unknown[]) {
    const position = positionOf(part, found);
    if (!position) return null;
    line.push(position);
  }
  return line;
}

function polygonOf(value: unknown, found: Found): Coordinate[][] | null {
  if (!Array.isArray(value) || value.length === 0) return null;
  const rings: Coordinate[][] = [];
  for (const part of value as unknown[]) {
    const ring = lineOf(part, found, 3);
    const [first, last] = [ring?.[0], ring?.at(-1)];
    if (ring && first && last && first[0] === last[0] && first[1] === last[1] && (first[2] === last[2] || Number.isNaN(first[2]))) ring.pop();
    if (!ring || ring.length < 3) return null;
    rings.push(ring);
  }
  return rings;
}

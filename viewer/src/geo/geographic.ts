import type { Vec2, Vec3 } from "../core/vec";

/** The local frame's position on earth, from rendering.json: spec/manifest.md, Geographic. */
export interface GeographicJson {
  readonly local: Vec2;
  readonly lon_lat: Vec2;
  readonly unit_m: number;
  readonly unit_deg: number;
  readonly degree: number;
  readonly to: readonly [readonly number[], readonly number[]];
  readonly back: readonly [readonly number[], readonly number[]];
}

/** Transforms a local position to longitude and latitude (WGS 84, degrees). */
export function lonLatFromLocal({ local, lon_lat, unit_m, degree, to }: GeographicJson, [x, y]: Vec2 | Vec3): Vec2 {
  const terms = computeTerms((x - local[0]) / unit_m, (y - local[1]) / unit_m, degree);
  const lon = lon_lat[0] + sum(to[0], terms);
  return [lon > 180 ? lon - 360 : lon < -180 ? lon + 360 : lon, lon_lat[1] + sum(to[1], terms)];
}

/** Transforms longitude and latitude to local x and y. */
export function localFromLonLat({ local, lon_lat, unit_deg, degree, back }: GeographicJson, [lon, lat]: Vec2): Vec2 {
  const east = ((((lon - lon_lat[0] + 180) % 360) + 360) % 360) - 180;
  const terms = computeTerms(east / unit_deg, (lat - lon_lat[1]) / unit_deg, degree);
  return [local[0] + sum(back[0], terms), local[1] + sum(back[1], terms)];
}

/** Converts an azimuth from true north to one from the local y axis, clockwise: subtracts the meridian convergence. */
export function localAzimuth(geographic: GeographicJson, [lon, lat]: Vec2, azimuth_deg: number): number {
  const angle = (azimuth_deg * Math.PI) / 180;
  const phi = (lat * Math.PI) / 180;
  // The meridian curves more than the prime vertical: a degree of latitude is shorter.
  const ratio = (1 - E2) / (1 - E2 * Math.sin(phi) ** 2);
  const [east, north] = [(Math.sin(angle) * STEP_DEG) / Math.cos(phi), (Math.cos(angle) * STEP_DEG) / ratio];
  const [ahead, behind] = [localFromLonLat(geographic, [lon + east, lat + north]), localFromLonLat(geographic, [lon - east, lat - north])];
  return ((Math.atan2(ahead[0] - behind[0], ahead[1] - behind[1]) * 180) / Math.PI + 360) % 360;
}

/** Squared eccentricity of the WGS 84 ellipsoid. */
const E2 = 0.00669437999014;
/** About 11 m. */
const STEP_DEG = 1e-4;

/** Evaluates the monomials 1, p, q, p², pq, q², … */
function computeTerms(p: number, q: number, degree: number): number[] {
  const terms: number[] = [];
  for (let total = 0; total <= degree; total++) for (let k = 0; k <= total; k++) terms.push(p ** (total - k) * q ** k);
  return terms;
}

const sum = (factors: readonly number[], terms: readonly number[]): number =>
  terms.reduce((all, term, k) => all + term * (factors[k] ?? 0), 0);

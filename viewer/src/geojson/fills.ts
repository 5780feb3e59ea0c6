import type { Vec2, Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import type { VisibleDepths } from "../map3d";
import { PolygonIndex } from "./polygonIndex";
import type { UvRect } from "./lineSections";

/** A polygon to fill; rings in local coordinates. */
export interface Polygon {
  readonly rings: readonly (readonly Vec3[])[];
  readonly draped: boolean;
}

/** The pixels that a polygon covers in a view. */
export interface PolygonCover {
  /** Bounding box in U and V. */
  readonly box: UvRect;
  /** Classifies the pixel at U and V, whose surface has depth d: 0 not covered, 1 covered, 2 covered, but behind the surface. */
  at(u: number, v: number, d: number): 0 | 1 | 2;
}

/** Returns null for a polygon that is seen edge-on. */
export const coverOf = (polygon: Polygon, relief: VisibleDepths): PolygonCover | null =>
  polygon.draped ? drapedCover(polygon, relief) : planeCover(polygon, relief);

/** Offset of the surface along the line of sight, so that filling a building's outline fills its walls, too. */
const BEHIND_M = 0.05;

/** Covers the surface whose horizontal position is inside the polygon, walls included. */
function drapedCover({ rings }: Polygon, { camera, heights }: VisibleDepths): PolygonCover {
  const { right, up, forward } = camera.frame.axes;
  const area = new PolygonIndex(rings.map((ring) => ring.map(([x, y]): Vec2 => [x, y])));
  const corners = [area.low, area.high].flatMap(([x]) =>
    [area.low, area.high].flatMap(([, y]) => heights.map((z) => uvdFromLocal(camera.frame.axes, [x, y, z]))),
  );
  return {
    box: boxOf(corners),
    at: (u, v, depth) => {
      const d = depth + BEHIND_M;
      return area.contains(u * right[0] + v * up[0] + d * forward[0], u * right[1] + v * up[1] + d * forward[1]) ? 1 : 0;
    },
  };
}

/** Covers the plane through the outer ring, at its own height. */
function planeCover({ rings }: Polygon, relief: VisibleDepths): PolygonCover | null {
  const flat = rings.map((ring) => ring.map((point) => uvdFromLocal(relief.camera.frame.axes, point)));
  const outer = flat[0] ?? [];
  const first = outer[0];
  if (!first) return null;
  const normal: [number, number, number] = [0, 0, 0];
  const middle: [number, number, number] = [0, 0, 0];
  outer.forEach((a, k) => {
    const b = outer[(k + 1) % outer.length] as Vec3;
    for (const axis of [0, 1, 2] as const) {
      const [p, q] = [(axis + 1) % 3, (axis + 2) % 3] as [0, 0];
      normal[axis] += (a[p] - first[p]) * (b[q] - first[q]) - (a[q] - first[q]) * (b[p] - first[p]);
      middle[axis] += a[axis] / outer.length;
    }
  });
  if (Math.abs(normal[2]) < 1e-6 * Math.hypot(...normal) || normal[2] === 0) return null;
  const [du, dv] = [-normal[0] / normal[2], -normal[1] / normal[2]];
  const area = new PolygonIndex(flat.map((ring) => ring.map(([u, v]): Vec2 => [u, v])));
  return {
    box: [area.low, area.high],
    at: (u, v) => (area.contains(u, v) ? (relief.isOccluded(u, v, middle[2] + du * (u - middle[0]) + dv * (v - middle[1])) ? 2 : 1) : 0),
  };
}

export function boxOf(points: Iterable<readonly number[]>): UvRect {
  let [u0, v0, u1, v1] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [u = 0, v = 0] of points) [u0, v0, u1, v1] = [Math.min(u0, u), Math.min(v0, v), Math.max(u1, u), Math.max(v1, v)];
  return [
    [u0, v0],
    [u1, v1],
  ];
}

export const overlaps = ([a, b]: UvRect, [c, d]: UvRect): boolean => a[0] <= d[0] && c[0] <= b[0] && a[1] <= d[1] && c[1] <= b[1];

/** A polygon in a view, with its fill colour. */
export interface PolygonFill {
  readonly cover: PolygonCover;
  readonly draped: boolean;
  readonly rgba: readonly [number, number, number, number];
  /** Opacity factor behind the surface. */
  readonly behind: number;
}

/** Returns the straight (not premultiplied) RGBA of a square tile with its top left corner at U and V; null for an empty tile. */
export function fillTile(
  relief: VisibleDepths,
  [left, top]: Vec2,
  side_px: number,
  fills: readonly PolygonFill[],
): Uint8ClampedArray<ArrayBuffer> | null {
  const px = relief.pixel_m;
  const square: UvRect = [
    [left, top - side_px * px],
    [left + side_px * px, top],
  ];
  const inside = fills.filter(({ cover }) => overlaps(cover.box, square));
  if (inside.length === 0) return null;
  const [depths, rgba] = [new Float64Array(side_px ** 2), new Uint8ClampedArray(4 * side_px ** 2)];
  for (let at = 0; at < depths.length; at++)
    depths[at] = relief.depthAt(left + ((at % side_px) + 0.5) * px, top - (Math.floor(at / side_px) + 0.5) * px);
  for (const fill of inside) {
    const [low, high] = fill.cover.box;
    const range = (from: number, to: number): Vec2 => [
      Math.max(0, Math.floor(from / px - 0.5)),
      Math.min(side_px, Math.ceil(to / px + 0.5)),
    ];
    const [i0, i1] = range(low[0] - left, high[0] - left);
    const [j0, j1] = range(top - high[1], top - low[1]);
    for (let j = j0; j < j1; j++) {
      for (let i = i0; i < i1; i++) {
        const depth = depths[j * side_px + i] as number;
        if (fill.draped && !Number.isFinite(depth)) continue;
        const covered = fill.cover.at(left + (i + 0.5) * px, top - (j + 0.5) * px, depth);
        if (covered > 0) blend(rgba, 4 * (j * side_px + i), fill.rgba, covered === 1 ? 1 : fill.behind);
      }
    }
  }
  return rgba;
}

function blend(rgba: Uint8ClampedArray, at: number, [r, g, b, a]: PolygonFill["rgba"], share: number): void {
  const [over, under] = [a * share, ((rgba[at + 3] as number) / 255) * (1 - a * share)];
  const total = over + under;
  if (total === 0) return;
  rgba[at] = (r * over + (rgba[at] as number) * under) / total;
  rgba[at + 1] = (g * over + (rgba[at + 1] as number) * under) / total;
  rgba[at + 2] = (b * over + (rgba[at + 2] as number) * under) / total;
  rgba[at + 3] = 255 * total;
}

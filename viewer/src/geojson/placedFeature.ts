import type { Vec2, Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import type { VisibleDepths } from "../map3d";
import { drapedHeight } from "./drape";
import { boxOf, coverOf, overlaps, type PolygonCover, type PolygonFill, type Polygon } from "./fills";
import { sectionsOf, type Path, type UvRect, type LineSection } from "./lineSections";
import type { Feature, FeatureShape } from "./parse";
import type { CoordinateTransform } from "./coordinates";
import type { ResolvedStyle } from "./style";

/** How parts behind buildings are shown. */
export type Occlusion = "hide" | "fade" | "none";

/** Opacity factor behind buildings. */
export const OPACITY_BEHIND: Readonly<Record<Occlusion, number>> = { hide: 0, fade: 0.35, none: 1 };

const MARGIN_PX = 4;

/** A feature in local coordinates, with the results computed for drawing it. */
export interface PlacedFeature {
  readonly feature: Feature;
  style: ResolvedStyle;
  readonly lines: readonly FeatureLine[];
  readonly polygons: readonly FeaturePolygon[];
  readonly dots: readonly FeatureDot[];
}

/** Converts a feature to local coordinates; returns null when no part of it is near the scene. @param ground ignores given heights */
export function placeFeature(
  { feature, points, lines, polygons }: FeatureShape,
  place: CoordinateTransform,
  ground: boolean,
  style: ResolvedStyle,
): PlacedFeature | null {
  const local = (coordinates: FeatureShape["lines"][0]): Vec3[] | null => {
    const found = coordinates.map(place);
    return found.every((position) => position !== null) ? found : null;
  };
  const isDraped = (positions: readonly Vec3[]): boolean => ground || positions.some(([, , z]) => Number.isNaN(z));
  const areas = polygons.flatMap((rings): Polygon[] => {
    const found = rings.map(local);
    return found.every((ring) => ring !== null) ? [{ rings: found, draped: found.some(isDraped) }] : [];
  });
  const outlines = areas.flatMap(({ rings, draped }) => rings.map((ring): Path => ({ points: [...ring, ring[0] as Vec3], draped })));
  const ways = lines.flatMap((line): Path[] => {
    const found = local(line);
    return found ? [{ points: found, draped: isDraped(found) }] : [];
  });
  const dots = points.flatMap((point): FeatureDot[] => {
    const position = place(point);
    return position ? [new FeatureDot(position, isDraped([position]))] : [];
  });
  if (areas.length + ways.length + dots.length === 0) return null;
  return {
    feature,
    style,
    lines: [...outlines, ...ways].map((path) => new FeatureLine(path)),
    polygons: areas.map((polygon) => new FeaturePolygon(polygon)),
    dots,
  };
}

/** Geometry computed from the surface and cached while the surface there does not change. */
abstract class CachedGeometry {
  /** Largest extent in U and V; null before `setView`. */
  protected box: UvRect | null = null;
  #level = NaN;
  #region: UvRect | null = null;
  #sources: readonly unknown[] = [];

  /** Sets a new view and discards the results. */
  setView(relief: VisibleDepths): void {
    this.box = this.boxIn(relief);
    this.invalidate();
  }

  /** Marks the results as stale; they are shown until they are computed again. */
  invalidate(): void {
    this.#region = null;
  }

  /** Is a part of it in a view stale? */
  isStale(relief: VisibleDepths, view: UvRect): boolean {
    const part = this.#part(relief, view);
    if (!part) return false;
    return (
      !this.#region || this.#level !== relief.level || !within(part, this.#region) || !same(this.#sources, relief.sources(this.#region))
    );
  }

  /** Computes the part in a region. */
  update(relief: VisibleDepths, region: UvRect, occlusion: Occlusion): void {
    const part = this.#part(relief, region);
    if (!part) return;
    [this.#level, this.#region, this.#sources] = [relief.level, part, relief.sources(part)];
    this.compute(relief, part, occlusion);
  }

  /** The part of the extent in a view, with a margin of some pixels, since the surface is sampled at pixels. */
  #part({ pixel_m }: VisibleDepths, view: UvRect): UvRect | null {
    const [[u0, v0], [u1, v1]] = this.box ?? [
      [Infinity, Infinity],
      [-Infinity, -Infinity],
    ];
    const more = MARGIN_PX * pixel_m;
    return intersection(
      [
        [u0 - more, v0 - more],
        [u1 + more, v1 + more],
      ],
      view,
    );
  }

  protected abstract boxIn(relief: VisibleDepths): UvRect;
  protected abstract compute(relief: VisibleDepths, region: UvRect, occlusion: Occlusion): void;
}

export class FeatureLine extends CachedGeometry {
  sections: readonly LineSection[] = [];
  readonly path: Path;

  constructor(path: Path) {
    super();
    this.path = path;
  }

  get reach(): UvRect | null {
    return this.box;
  }

  override setView(relief: VisibleDepths): void {
    super.setView(relief);
    this.sections = [];
  }

  protected boxIn(relief: VisibleDepths): UvRect {
    return boxIn(this.path.points, this.path.draped, relief);
  }

  protected compute(relief: VisibleDepths, region: UvRect, occlusion: Occlusion): void {
    this.sections = sectionsOf(this.path, relief, region, occlusion !== "none");
  }
}

export class FeatureDot extends CachedGeometry {
  /** U, V and D; null until it is computed. */
  at: Vec3 | null = null;
  hidden = false;
  /** Local; at the scene's lowest height until the height is known. */
  position: Vec3;
  readonly draped: boolean;
  #height = NaN;

  constructor(position: Vec3, draped: boolean) {
    super();
    [this.position, this.draped] = [position, draped];
  }

  protected boxIn(relief: VisibleDepths): UvRect {
    this.at = null;
    return boxIn([this.position], this.draped, relief);
  }

  /** Updates the height from the surface. @returns false while the height is not known */
  updateHeight(relief: VisibleDepths): boolean {
    const all: UvRect = [
      [-Infinity, -Infinity],
      [Infinity, Infinity],
    ];
    if (!this.box) this.setView(relief);
    if (this.isStale(relief, all)) this.update(relief, all, "none");
    return !Number.isNaN(this.#height);
  }

  /** Keeps the last visible height while the point is hidden. */
  protected compute(relief: VisibleDepths, _: UvRect, occlusion: Occlusion): void {
    const [x, y, z] = this.position;
    const height = this.draped ? drapedHeight(relief, x, y) : z;
    if (height === null && Number.isNaN(this.#height)) return;
    if (height !== null && !Number.isNaN(height)) this.#height = height;
    this.position = [x, y, Number.isNaN(this.#height) ? relief.heights[0] : this.#height];
    this.at = uvdFromLocal(relief.camera.frame.axes, this.position);
    this.hidden = occlusion !== "none" && relief.isOccluded(...this.at);
  }
}

/** A polygon that can be filled. */
export class FeaturePolygon {
  #cover: PolygonCover | null = null;
  readonly #polygon: Polygon;

  constructor(polygon: Polygon) {
    this.#polygon = polygon;
  }

  setView(relief: VisibleDepths): void {
    this.#cover = coverOf(this.#polygon, relief);
  }

  fillIn({ fill }: ResolvedStyle, occlusion: Occlusion): PolygonFill | null {
    return this.#cover && fill && { cover: this.#cover, draped: this.#polygon.draped, rgba: fill, behind: OPACITY_BEHIND[occlusion] };
  }

  /** Is the polygon visible at U and V? */
  covers(relief: VisibleDepths, [u, v]: Vec2, occlusion: Occlusion): boolean {
    const depth = relief.depthAt(u, v);
    if (this.#polygon.draped && !Number.isFinite(depth)) return false;
    const covered = this.#cover?.at(u, v, depth) ?? 0;
    return covered === 1 || (covered === 2 && occlusion !== "hide");
  }
}

function boxIn(points: readonly Vec3[], draped: boolean, { camera, heights }: VisibleDepths): UvRect {
  const { axes } = camera.frame;
  return boxOf(points.flatMap(([x, y, z]) => (draped ? heights : [z]).map((height) => uvdFromLocal(axes, [x, y, height]))));
}

export function intersection(a: UvRect, b: UvRect): UvRect | null {
  return overlaps(a, b)
    ? [
        [Math.max(a[0][0], b[0][0]), Math.max(a[0][1], b[0][1])],
        [Math.min(a[1][0], b[1][0]), Math.min(a[1][1], b[1][1])],
      ]
    : null;
}

export const within = (a: UvRect, b: UvRect): boolean =>
  a[0][0] >= b[0][0] && a[0][1] >= b[0][1] && a[1][0] <= b[1][0] && a[1][1] <= b[1][1];

export const same = (a: readonly unknown[], b: readonly unknown[]): boolean =>
  a.length === b.length && a.every((member, k) => member === b[k]);

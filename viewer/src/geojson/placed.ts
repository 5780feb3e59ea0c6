import type { Vec2, Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import type { Relief } from "../map3d";
import { landing } from "./drape";
import { boxOf, coverIn, meet, type Cover, type Filling, type Polygon } from "./fills";
import { runsOf, type Path, type Rect, type Run } from "./runs";
import type { Feature, Shape } from "./parse";
import type { Placing } from "./place";
import type { FilledStyle } from "./style";

/** What becomes of parts behind buildings. */
export type Occlusion = "hide" | "fade" | "none";

/** What of it is seen behind buildings. */
export const BEHIND: Readonly<Record<Occlusion, number>> = { hide: 0, fade: 0.35, none: 1 };

const AROUND_PX = 4;

/** A feature on the map. */
export interface Placed {
  readonly feature: Feature;
  style: FilledStyle;
  readonly lines: readonly Line[];
  readonly polygons: readonly Filled[];
  readonly spots: readonly Spot[];
}

/** The feature of a shape where it lies; null when nothing of it is near the scene. @param ground heights that are given do not count */
export function placedShape({ feature, points, lines, polygons }: Shape, place: Placing, ground: boolean, style: FilledStyle): Placed | null {
  const local = (coordinates: Shape["lines"][0]): Vec3[] | null => {
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
  const spots = points.flatMap((point): Spot[] => {
    const position = place(point);
    return position ? [new Spot(position, isDraped([position]))] : [];
  });
  if (areas.length + ways.length + spots.length === 0) return null;
  return { feature, style, lines: [...outlines, ...ways].map((path) => new Line(path)), polygons: areas.map((polygon) => new Filled(polygon)), spots };
}

/** What is computed from the surface once and kept as long as the surface is the same there. */
abstract class Kept {
  /** U and V that it can take up; null before `turn`. */
  protected box: Rect | null = null;
  #level = NaN;
  #region: Rect | null = null;
  #sources: readonly unknown[] = [];

  /** The view is another: nothing is known any more. */
  turn(relief: Relief): void {
    this.box = this.boxIn(relief);
    this.forget();
  }

  /** To be computed anew, shown as before until then. */
  forget(): void {
    this.#region = null;
  }

  /** Is there something to compute of it within a view? */
  stale(relief: Relief, view: Rect): boolean {
    const part = this.#part(relief, view);
    if (!part) return false;
    return !this.#region || this.#level !== relief.level || !within(part, this.#region) || !same(this.#sources, relief.sources(this.#region));
  }

  /** @param region of which it is computed, at least */
  update(relief: Relief, region: Rect, occlusion: Occlusion): void {
    const part = this.#part(relief, region);
    if (!part) return;
    [this.#level, this.#region, this.#sources] = [relief.level, part, relief.sources(part)];
    this.compute(relief, part, occlusion);
  }

  /** Some pixels around the box: surfaces are met at pixels. */
  #part({ pixel_m }: Relief, view: Rect): Rect | null {
    const [[u0, v0], [u1, v1]] = this.box ?? [[Infinity, Infinity], [-Infinity, -Infinity]];
    const more = AROUND_PX * pixel_m;
    return overlap([[u0 - more, v0 - more], [u1 + more, v1 + more]], view);
  }

  protected abstract boxIn(relief: Relief): Rect;
  protected abstract compute(relief: Relief, region: Rect, occlusion: Occlusion): void;
}

export class Line extends Kept {
  runs: readonly Run[] = [];
  readonly path: Path;

  constructor(path: Path) {
    super();
    this.path = path;
  }

  get reach(): Rect | null {
    return this.box;
  }

  override turn(relief: Relief): void {
    super.turn(relief);
    this.runs = [];
  }

  protected boxIn(relief: Relief): Rect {
    return boxIn(this.path.points, this.path.draped, relief);
  }

  protected compute(relief: Relief, region: Rect, occlusion: Occlusion): void {
    this.runs = runsOf(this.path, relief, region, occlusion !== "none");
  }
}

export class Spot extends Kept {
  /** U, V, D; null: not known yet. */
  at: Vec3 | null = null;
  hidden = false;
  /** Local; on the lowest ground before anything is known. */
  position: Vec3;
  readonly draped: boolean;
  #height = NaN;

  constructor(position: Vec3, draped: boolean) {
    super();
    [this.position, this.draped] = [position, draped];
  }

  protected boxIn(relief: Relief): Rect {
    this.at = null;
    return boxIn([this.position], this.draped, relief);
  }

  /** Puts it onto the surface when something is new. @returns false while nothing is known */
  settle(relief: Relief): boolean {
    const all: Rect = [[-Infinity, -Infinity], [Infinity, Infinity]];
    if (!this.box) this.turn(relief);
    if (this.stale(relief, all)) this.update(relief, all, "none");
    return !Number.isNaN(this.#height);
  }

  /** A height that was seen once counts where it is hidden. */
  protected compute(relief: Relief, _: Rect, occlusion: Occlusion): void {
    const [x, y, z] = this.position;
    const height = this.draped ? landing(relief, x, y) : z;
    if (height === null && Number.isNaN(this.#height)) return;
    if (height !== null && !Number.isNaN(height)) this.#height = height;
    this.position = [x, y, Number.isNaN(this.#height) ? relief.heights[0] : this.#height];
    this.at = uvdFromLocal(relief.camera.frame.axes, this.position);
    this.hidden = occlusion !== "none" && relief.isOccluded(...this.at);
  }
}

/** A polygon to fill. */
export class Filled {
  #cover: Cover | null = null;
  readonly #polygon: Polygon;

  constructor(polygon: Polygon) {
    this.#polygon = polygon;
  }

  turn(relief: Relief): void {
    this.#cover = coverIn(this.#polygon, relief);
  }

  filling({ fill }: FilledStyle, occlusion: Occlusion): Filling | null {
    return this.#cover && fill && { cover: this.#cover, draped: this.#polygon.draped, rgba: fill, behind: BEHIND[occlusion] };
  }

  /** Is it seen at U and V? */
  has(relief: Relief, [u, v]: Vec2, occlusion: Occlusion): boolean {
    const depth = relief.depthAt(u, v);
    if (this.#polygon.draped && !Number.isFinite(depth)) return false;
    const covered = this.#cover?.at(u, v, depth) ?? 0;
    return covered === 1 || (covered === 2 && occlusion !== "hide");
  }
}

function boxIn(points: readonly Vec3[], draped: boolean, { camera, heights }: Relief): Rect {
  const { axes } = camera.frame;
  return boxOf(points.flatMap(([x, y, z]) => (draped ? heights : [z]).map((height) => uvdFromLocal(axes, [x, y, height]))));
}

export function overlap(a: Rect, b: Rect): Rect | null {
  return meet(a, b) ? [[Math.max(a[0][0], b[0][0]), Math.max(a[0][1], b[0][1])], [Math.min(a[1][0], b[1][0]), Math.min(a[1][1], b[1][1])]] : null;
}

export const within = (a: Rect, b: Rect): boolean => a[0][0] >= b[0][0] && a[0][1] >= b[0][1] && a[1][0] <= b[1][0] && a[1][1] <= b[1][1];

export const same = (a: readonly unknown[], b: readonly unknown[]): boolean => a.length === b.length && a.every((member, k) => member === b[k]);

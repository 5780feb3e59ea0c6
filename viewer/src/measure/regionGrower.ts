import { loopsOf, stepsOf } from "./outline";

/** Depth and id of each visible pixel. */
export interface PixelSource {
  /** Metres; Infinity without a surface. */
  depthAt(u: number, v: number): number;
  idAt(u: number, v: number): number;
  readonly pixel_m: number;
}

/** Bounds in columns and rows of pixels or tiles; right and bottom are exclusive. */
export type GridBounds = readonly [left: number, top: number, right: number, bottom: number];

/** The part of the view in which a region can grow. */
export interface RegionWindow {
  /** U and V of the upper left corner of pixel (0, 0), metres. */
  readonly u0: number;
  readonly v0: number;
  readonly bounds: GridBounds;
  /** Bits of the sides (left, top, right, bottom) at which the window can be enlarged. */
  readonly open: number;
}

/** Plane D = d + x · columns + y · rows, counted from the start pixel; metres. */
export interface PixelPlane {
  readonly d: number;
  readonly x: number;
  readonly y: number;
  /** Root mean square distance of its pixels. */
  readonly rms_m: number;
}

/** The pixels of a planar face. */
export interface PlanarRegion {
  readonly plane: PixelPlane;
  /** Number of pixels, with fractions where the border is a crease. */
  readonly pixels: number;
  /** Fraction of the border where something nearer is in front of the plane. */
  readonly hidden: number;
  /** Corners of the borders: column, row and D (metres). */
  readonly loops: readonly (readonly (readonly [column: number, row: number, d: number])[])[];
}

/** Tolerance perpendicular to the plane while the region grows: metres and pixels. */
const [TOLERANCE_M, TOLERANCE_PX] = [0.05, 0.75];
/** Least tolerance in the last rounds, in addition to the scatter of the pixels. */
const FINAL_TOLERANCE_M = 0.01;
const FIRST_RADIUS_PX = 3;
/** Largest number of pixels that a plane is fitted to. */
const MAX_FITTED = 20_000;
/** Margin of pixels around the window that are read but not added. */
const PAD = 2;

/** Grows the planar region of one object around a start pixel. */
export class RegionGrower {
  /** Bits of the window's sides that the region touches. */
  #touches = 0;
  readonly #source: PixelSource;
  readonly #window: RegionWindow;
  readonly #width: number;
  readonly #height: number;
  /** Index offsets to the pixels above, right, below and left. */
  readonly #steps: readonly number[];
  /** The start pixel: column and row, D and id. */
  readonly #x: number;
  readonly #y: number;
  readonly #d: number;
  readonly #id: number;
  readonly #depths: Float32Array;
  /** 0: not read, 1: the same object, 2: another object or outside. */
  readonly #kinds: Uint8Array;
  readonly #mask: Uint8Array;
  /** Indices of the pixels in the mask. */
  readonly #found: Int32Array;
  #count = 0;

  constructor(source: PixelSource, window: RegionWindow, column: number, row: number) {
    const [left, top, right, bottom] = window.bounds;
    [this.#source, this.#window, this.#width, this.#height] = [source, window, right - left + 2 * PAD, bottom - top + 2 * PAD];
    [this.#x, this.#y, this.#steps] = [column - left + PAD, row - top + PAD, stepsOf(this.#width)];
    const size = this.#width * this.#height;
    [this.#depths, this.#kinds, this.#mask, this.#found] = [
      new Float32Array(size),
      new Uint8Array(size),
      new Uint8Array(size),
      new Int32Array(size),
    ];
    const [u, v] = this.#centerOf(this.#x, this.#y);
    [this.#d, this.#id] = [source.depthAt(u, v), source.idAt(u, v)];
  }

  /** Grows the region. @returns null where no plane fits; bits of the touched sides where the window is too small */
  grow(): PlanarRegion | number | null {
    let plane = Number.isFinite(this.#d) ? this.#fitFirstPlane() : null;
    if (!plane) return null;
    // The radius doubles, since the first plane is fitted to a few pixels only. Two last rounds use a tolerance from the scatter of the pixels.
    for (let [radius, rounds] = [FIRST_RADIUS_PX, 2]; rounds > 0; radius *= 2) {
      if (radius === Infinity) rounds--;
      const tolerance_m = this.#tolerance(plane);
      const more = this.#fillMask(
        plane,
        radius === Infinity ? Math.min(tolerance_m, FINAL_TOLERANCE_M * this.#areaFactor(plane) + 3 * plane.rms_m) : tolerance_m,
        radius,
      );
      if (this.#touches & this.#window.open) return this.#touches;
      plane = this.#fitPlane(true) ?? this.#fitPlane() ?? plane;
      if (!more) radius = Infinity;
    }
    const { d, x, y } = plane;
    const [left, top] = this.#window.bounds;
    const loops = loopsOf(this.#mask, this.#width).map((loop) =>
      loop.map(([i, j]) => [i + left - PAD, j + top - PAD, this.#d + d + x * (i - 0.5 - this.#x) + y * (j - 0.5 - this.#y)] as const),
    );
    return { plane, ...this.#measureBorder(plane), loops };
  }

  /** Fits a plane to each block of 3 × 3 pixels that contains the start pixel, and returns the best one, so that the start pixel can be at an edge. */
  #fitFirstPlane(): PixelPlane | null {
    let best: PixelPlane | null = null;
    for (let k = 0; k < 9; k++) {
      this.#count = 0;
      for (let n = 0; n < 9; n++) {
        const at = (this.#y + Math.floor(k / 3) + Math.floor(n / 3) - 2) * this.#width + this.#x + (k % 3) + (n % 3) - 2;
        if (this.#kind(at) === 1) this.#found[this.#count++] = at;
      }
      const plane = this.#fitPlane();
      // A plane that does not contain the start pixel belongs to another face.
      if (plane && Math.abs(plane.d) <= this.#tolerance(plane) && !(best && best.rms_m < plane.rms_m)) best = plane;
    }
    return best;
  }

  /** Flood-fills the mask from the start pixel. @returns true when the region reaches the radius (columns, rows) */
  #fillMask(plane: PixelPlane, tolerance_m: number, radius: number): boolean {
    const [width, found, mask, steps, x0, y0] = [this.#width, this.#found, this.#mask, this.#steps, this.#x, this.#y];
    const [right, bottom] = [width - PAD - 1, this.#height - PAD - 1];
    mask.fill(0);
    let [count, more] = [1, false];
    mask[(found[0] = y0 * width + x0)] = 1;
    for (let k = 0; k < count; k++) {
      const at = found[k] as number;
      const y = Math.floor(at / width);
      const x = at - y * width;
      this.#touches |= (x === PAD ? 1 : 0) | (y === PAD ? 2 : 0) | (x === right ? 4 : 0) | (y === bottom ? 8 : 0);
      if (Math.max(Math.abs(x - x0), Math.abs(y - y0)) >= radius) more = true;
      else {
        for (const step of steps) {
          const next = at + step;
          if (mask[next] === 1 || this.#kind(next) !== 1 || !(Math.abs(this.#distanceBehind(plane, next)) <= tolerance_m)) continue;
          mask[next] = 1;
          found[count++] = next;
        }
      }
    }
    this.#count = count;
    return more;
  }

  /** Fits a plane by least squares; null for fewer than five pixels or collinear ones. @param within leaves out pixels at the border, which can belong to another face */
  #fitPlane(within = false): PixelPlane | null {
    const step = Math.ceil(this.#count / MAX_FITTED);
    const counted: number[] = [];
    for (let k = 0; k < this.#count; k += step) {
      const at = this.#found[k] as number;
      if (!within || this.#steps.every((way) => this.#mask[at + way])) counted.push(at);
    }
    const n = counted.length;
    const sum = (of: (x: number, y: number, d: number) => number): number =>
      counted.reduce(
        (all, at) => all + of((at % this.#width) - this.#x, Math.floor(at / this.#width) - this.#y, this.#depths[at] as number),
        0,
      );
    const [mx, my, md] = [sum((x) => x) / n, sum((_, y) => y) / n, sum((_x, _y, d) => d) / n];
    const [xx, xy, yy] = [sum((x) => (x - mx) ** 2), sum((x, y) => (x - mx) * (y - my)), sum((_, y) => (y - my) ** 2)];
    const [xd, yd] = [sum((x, _, d) => (x - mx) * (d - md)), sum((_, y, d) => (y - my) * (d - md))];
    const det = xx * yy - xy * xy;
    if (n < 5 || det < 0.5) return null;
    const [a, b] = [(xd * yy - yd * xy) / det, (yd * xx - xd * xy) / det];
    return { x: a, y: b, d: md - a * mx - b * my, rms_m: Math.sqrt(sum((x, y, d) => (d - md - a * (x - mx) - b * (y - my)) ** 2) / n) };
  }

  /**
   * Classifies each border pixel by the two pixels beyond it. If their line meets the plane within a pixel, the border is a crease, and the pixel counts up to
   * there. Otherwise it is a step, which hides the face if the pixels beyond are in front of the plane.
   */
  #measureBorder(plane: PixelPlane): Pick<PlanarRegion, "pixels" | "hidden"> {
    let [border, covered, pixels] = [0, 0, this.#count];
    for (const at of this.#found.subarray(0, this.#count)) {
      for (const step of this.#steps) {
        if (this.#mask[at + step]) continue;
        const [first, second] = [-this.#distanceBehind(plane, at + step), -this.#distanceBehind(plane, at + 2 * step)];
        const crease = 1 - first / (second - first);
        if (crease >= 0 && crease <= 1) pixels += crease - 0.5;
        border++;
        if (Math.min(first, 2 * first - second) > this.#tolerance(plane)) covered++;
      }
    }
    return { pixels, hidden: covered / border };
  }

  /** Largest distance of a pixel from the plane along the line of sight, metres. */
  #tolerance(plane: PixelPlane): number {
    return (TOLERANCE_M + TOLERANCE_PX * this.#source.pixel_m) * this.#areaFactor(plane);
  }

  /** Area on the plane per area on the screen. */
  #areaFactor({ x, y }: PixelPlane): number {
    return Math.hypot(1, x / this.#source.pixel_m, y / this.#source.pixel_m);
  }

  /** Distance of a pixel behind the plane, metres. */
  #distanceBehind({ d, x, y }: PixelPlane, at: number): number {
    this.#kind(at);
    return (this.#depths[at] as number) - (d + x * ((at % this.#width) - this.#x) + y * (Math.floor(at / this.#width) - this.#y));
  }

  #kind(at: number): number {
    return this.#kinds[at] || this.#read(at);
  }

  #read(at: number): number {
    const [i, j] = [at % this.#width, Math.floor(at / this.#width)];
    const [u, v] = this.#centerOf(i, j);
    const depth = this.#source.depthAt(u, v);
    const within = Math.min(i, j, this.#width - 1 - i, this.#height - 1 - j) >= PAD;
    this.#depths[at] = depth - this.#d;
    return (this.#kinds[at] = within && Number.isFinite(depth) && this.#source.idAt(u, v) === this.#id ? 1 : 2);
  }

  #centerOf(i: number, j: number): [u: number, v: number] {
    const {
      u0,
      v0,
      bounds: [left, top],
    } = this.#window;
    const px = this.#source.pixel_m;
    return [u0 + (left + i - PAD + 0.5) * px, v0 - (top + j - PAD + 0.5) * px];
  }
}

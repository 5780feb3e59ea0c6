import { loopsOf, stepsOf } from "./outline";

/** What is seen, pixel by pixel. */
export interface Picture {
  /** Metres; Infinity where nothing is. */
  depthAt(u: number, v: number): number;
  idAt(u: number, v: number): number;
  readonly pixel_m: number;
}

/** Columns and rows, those of right and bottom left out; or tiles. */
export type Sides = readonly [left: number, top: number, right: number, bottom: number];

/** A part of a picture in which a region grows. */
export interface Window {
  /** Metres, of the upper left corner of pixel (0, 0). */
  readonly u0: number;
  readonly v0: number;
  readonly sides: Sides;
  /** Bits of the sides at which it could be wider. */
  readonly open: number;
}

/** D = d + x · (columns from the middle) + y · (rows from it); metres. */
export interface Plane {
  readonly d: number;
  readonly x: number;
  readonly y: number;
  /** Of its pixels, root mean square. */
  readonly rms_m: number;
}

/** Pixels of a face. */
export interface Region {
  readonly plane: Plane;
  /** Parts of pixels count where the border is a crease. */
  readonly pixels: number;
  /** Share of the border where something nearer stands before the plane. */
  readonly hidden: number;
  /** Corners of its borders in columns, rows and metres of D. */
  readonly loops: readonly (readonly (readonly [column: number, row: number, d: number])[])[];
}

/** Off a plane, at right angles to it: metres, and pixels. */
const [NEAR_M, NEAR_PX] = [0.05, 0.75];
/** The same in the end, besides what the pixels scatter by. */
const LEAST_M = 0.01;
const FIRST_RADIUS_PX = 3;
/** Pixels that a plane is fitted to, of all that there are. */
const FITTED = 20_000;
/** Pixels around the window that are looked at, but not taken. */
const PAD = 2;

/** Grows the flat piece of one object around a pixel. */
export class Growing {
  /** Bits of the window's sides that it touches. */
  #touches = 0;
  readonly #picture: Picture;
  readonly #window: Window;
  readonly #width: number;
  readonly #height: number;
  /** From a pixel to those above, right, below and left of it. */
  readonly #steps: readonly number[];
  /** Of the middle, from which all is counted: column and row, D and id. */
  readonly #x: number;
  readonly #y: number;
  readonly #d: number;
  readonly #id: number;
  readonly #depths: Float32Array;
  /** 0: not read, 1: the same object, 2: another, or outside. */
  readonly #kinds: Uint8Array;
  readonly #mask: Uint8Array;
  /** Places of the pixels in the mask. */
  readonly #found: Int32Array;
  #count = 0;

  constructor(picture: Picture, window: Window, column: number, row: number) {
    const [left, top, right, bottom] = window.sides;
    [this.#picture, this.#window, this.#width, this.#height] = [picture, window, right - left + 2 * PAD, bottom - top + 2 * PAD];
    [this.#x, this.#y, this.#steps] = [column - left + PAD, row - top + PAD, stepsOf(this.#width)];
    const size = this.#width * this.#height;
    [this.#depths, this.#kinds, this.#mask, this.#found] = [new Float32Array(size), new Uint8Array(size), new Uint8Array(size), new Int32Array(size)];
    const [u, v] = this.#placeOf(this.#x, this.#y);
    [this.#d, this.#id] = [picture.depthAt(u, v), picture.idAt(u, v)];
  }

  /** null where no plane can be laid through what is there; a number where the window is too small: bits of the sides that are touched. */
  grown(): Region | number | null {
    let plane = Number.isFinite(this.#d) ? this.#first() : null;
    if (!plane) return null;
    // In growing circles, since the first plane is known from a few pixels only; then once more with what the pixels themselves allow.
    for (let [radius, rounds] = [FIRST_RADIUS_PX, 2]; rounds > 0; radius *= 2) {
      if (radius === Infinity) rounds--;
      const loose = this.#loose(plane);
      const more = this.#grow(plane, radius === Infinity ? Math.min(loose, LEAST_M * this.#stretch(plane) + 3 * plane.rms_m) : loose, radius);
      if (this.#touches & this.#window.open) return this.#touches;
      plane = this.#fitted(true) ?? this.#fitted() ?? plane;
      if (!more) radius = Infinity;
    }
    const { d, x, y } = plane;
    const [left, top] = this.#window.sides;
    const loops = loopsOf(this.#mask, this.#width).map((loop) => loop.map(([i, j]) => [i + left - PAD, j + top - PAD, this.#d + d + x * (i - 0.5 - this.#x) + y * (j - 0.5 - this.#y)] as const));
    return { plane, ...this.#measured(plane), loops };
  }

  /** Of the 3 × 3 pixels around the middle or beside it that lie best in a plane, so that it may stand at an edge. */
  #first(): Plane | null {
    let best: Plane | null = null;
    for (let k = 0; k < 9; k++) {
      this.#count = 0;
      for (let n = 0; n < 9; n++) {
        const at = (this.#y + Math.floor(k / 3) + Math.floor(n / 3) - 2) * this.#width + this.#x + (k % 3) + (n % 3) - 2;
        if (this.#kind(at) === 1) this.#found[this.#count++] = at;
      }
      const plane = this.#fitted();
      // A plane that passes the middle itself by is another face's.
      if (plane && Math.abs(plane.d) <= this.#loose(plane) && !(best && best.rms_m < plane.rms_m)) best = plane;
    }
    return best;
  }

  /** Fills the mask from the middle on. @returns true: there may be more beyond the radius (columns, rows) */
  #grow(plane: Plane, tolerance_m: number, radius: number): boolean {
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
          if (mask[next] === 1 || this.#kind(next) !== 1 || !(Math.abs(this.#off(plane, next)) <= tolerance_m)) continue;
          mask[next] = 1;
          found[count++] = next;
        }
      }
    }
    this.#count = count;
    return more;
  }

  /** By least squares; null for fewer than five pixels, or those on a line. `within`: without those at the region's border, which may be another face's. */
  #fitted(within = false): Plane | null {
    const step = Math.ceil(this.#count / FITTED);
    const counted: number[] = [];
    for (let k = 0; k < this.#count; k += step) {
      const at = this.#found[k] as number;
      if (!within || this.#steps.every((way) => this.#mask[at + way])) counted.push(at);
    }
    const n = counted.length;
    const sum = (of: (x: number, y: number, d: number) => number): number => counted.reduce((all, at) => all + of((at % this.#width) - this.#x, Math.floor(at / this.#width) - this.#y, this.#depths[at] as number), 0);
    const [mx, my, md] = [sum((x) => x) / n, sum((_, y) => y) / n, sum((_x, _y, d) => d) / n];
    const [xx, xy, yy] = [sum((x) => (x - mx) ** 2), sum((x, y) => (x - mx) * (y - my)), sum((_, y) => (y - my) ** 2)];
    const [xd, yd] = [sum((x, _, d) => (x - mx) * (d - md)), sum((_, y, d) => (y - my) * (d - md))];
    const det = xx * yy - xy * xy;
    if (n < 5 || det < 0.5) return null;
    const [a, b] = [(xd * yy - yd * xy) / det, (yd * xx - xd * xy) / det];
    return { x: a, y: b, d: md - a * mx - b * my, rms_m: Math.sqrt(sum((x, y, d) => (d - md - a * (x - mx) - b * (y - my)) ** 2) / n) };
  }

  /**
   * What goes on beyond the border from the plane itself is a crease: it stands where both meet, told by two pixels beyond. Else there is a step; the
   * border counts as hidden where what is beyond stands before the plane.
   */
  #measured(plane: Plane): Pick<Region, "pixels" | "hidden"> {
    let [all, before, pixels] = [0, 0, this.#count];
    for (const at of this.#found.subarray(0, this.#count)) {
      for (const step of this.#steps) {
        if (this.#mask[at + step]) continue;
        const [first, second] = [-this.#off(plane, at + step), -this.#off(plane, at + 2 * step)];
        const crease = 1 - first / (second - first);
        if (crease >= 0 && crease <= 1) pixels += crease - 0.5;
        all++;
        if (Math.min(first, 2 * first - second) > this.#loose(plane)) before++;
      }
    }
    return { pixels, hidden: before / all };
  }

  /** Metres along the line of sight that may lie between a pixel and the plane. */
  #loose(plane: Plane): number {
    return (NEAR_M + NEAR_PX * this.#picture.pixel_m) * this.#stretch(plane);
  }

  /** Square metres of the plane a square metre of the picture. */
  #stretch({ x, y }: Plane): number {
    return Math.hypot(1, x / this.#picture.pixel_m, y / this.#picture.pixel_m);
  }

  /** How far a pixel lies behind the plane. */
  #off({ d, x, y }: Plane, at: number): number {
    this.#kind(at);
    return (this.#depths[at] as number) - (d + x * ((at % this.#width) - this.#x) + y * (Math.floor(at / this.#width) - this.#y));
  }

  #kind(at: number): number {
    return this.#kinds[at] || this.#read(at);
  }

  #read(at: number): number {
    const [i, j] = [at % this.#width, Math.floor(at / this.#width)];
    const [u, v] = this.#placeOf(i, j);
    const depth = this.#picture.depthAt(u, v);
    const within = Math.min(i, j, this.#width - 1 - i, this.#height - 1 - j) >= PAD;
    this.#depths[at] = depth - this.#d;
    return (this.#kinds[at] = within && Number.isFinite(depth) && this.#picture.idAt(u, v) === this.#id ? 1 : 2);
  }

  #placeOf(i: number, j: number): [u: number, v: number] {
    const { u0, v0, sides: [left, top] } = this.#window;
    const px = this.#picture.pixel_m;
    return [u0 + (left + i - PAD + 0.5) * px, v0 - (top + j - PAD + 0.5) * px];
  }
}

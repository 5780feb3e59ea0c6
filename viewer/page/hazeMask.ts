import { dot, type Box3, type Vec2, type Vec3 } from "../src/core/vec";
import type { Frame } from "../src/geo/frame";

/** Width of the haze as a share of the greatest distance from the edge, and as a share of the side at most. */
const [WIDTH, MAX_WIDTH] = [0.22, 0.05];
/** Content that is narrower than this share of the side, such as buildings without ground, has no haze. */
const NARROW = 0.05;
/** Pixels from one column to the next that make the side of a tower. */
const MIN_RISE = 3;

/** Computes the opacity of the haze (0 to 255): full outside the content and at its edge, none far inside. Holes in the content and towers that rise above its edge have no haze. @param inside 1 for content, row by row; changed  @returns null where all content is narrow */
export function computeHaze(inside: Uint8Array, side: number): Uint8ClampedArray | null {
  const outside = findOutside(inside, side);
  const distances = computeDistances(outside, side);
  const greatest = distances.reduce((most, distance) => Math.max(most, distance), 0);
  if (greatest < NARROW * side) return null;
  const width = Math.min(WIDTH * greatest, MAX_WIDTH * side);
  const haze = Uint8ClampedArray.from(distances, (distance) => {
    const share = Math.min(Math.max((distance - 1) / width, 0), 1);
    return 255 * (1 - share * share * (3 - 2 * share));
  });
  clearTowers(haze, outside, side, 2 * Math.ceil(width) + 1);
  return haze;
}

/** Clears the haze over a local box, so that it veils no object in it. */
export function clearBox(
  haze: Uint8ClampedArray,
  side: number,
  { axes, u0, v0, size }: Pick<Frame, "axes" | "u0" | "v0" | "size">,
  box: Box3,
): void {
  const { right, up } = axes;
  const corners = Array.from({ length: 8 }, (_, k) => [0, 1, 2].map((axis) => box[((k >> axis) & 1) as 0][axis as 0]) as unknown as Vec3);
  // The picture of a box is where the pictures of its three edges bound it.
  const bounds = [0, 1, 2].map((axis) => {
    const normal: Vec2 = [-up[axis as 0], right[axis as 0]];
    const at = corners.map((corner) => normal[0] * dot(right, corner) + normal[1] * dot(up, corner));
    return [normal, Math.min(...at), Math.max(...at)] as const;
  });
  // The mask is enlarged smoothly: a pixel more on each side.
  const px = size / side;
  const isInside = (u: number, v: number): boolean =>
    bounds.every(([[a, b], low, high]) => {
      const margin = px * (Math.abs(a) + Math.abs(b));
      return a * u + b * v >= low - margin && a * u + b * v <= high + margin;
    });
  haze.forEach((_, k) => {
    if (isInside(u0 + ((k % side) + 0.5) * px, v0 - (Math.floor(k / side) + 0.5) * px)) haze[k] = 0;
  });
}

/** Clears the haze over towers: what rises steeply above the upper edge of the content and is narrower than `window` pixels, with the edge at its foot and a pixel on each side. Corners are no towers: at most one of their sides is steep. */
function clearTowers(haze: Uint8ClampedArray, outside: Uint8Array, side: number, window: number): void {
  const columns = Array.from({ length: side }, (_, x) => x);
  const tops = columns.map((x) => columns.find((y) => outside[y * side + x] === 0) ?? side);
  const topAt = (x: number): number => tops[x] ?? side;
  const cleared = haze.slice();
  for (const x of columns) {
    // The nearest columns on both sides that are clearly lower.
    const [left, right] = [-1, 1].map((step) => {
      let at = x + step;
      while (Math.abs(at - x) < window && topAt(at) < topAt(x) + MIN_RISE) at += step;
      return topAt(at) - topAt(at - step) < MIN_RISE ? null : at;
    }) as [number | null, number | null];
    if (left === null || right === null || right - left > window) continue;
    const edge = Math.min(topAt(left), topAt(right));
    for (let y = topAt(x); y < edge + window && (haze[y * side + x] ?? 0) > 0; y++)
      for (const near of [x - 1, x, x + 1]) if (near >= 0 && near < side) cleared[y * side + near] = 0;
  }
  haze.set(cleared);
}

/** Finds what is connected to the border without content. */
function findOutside(inside: Uint8Array, side: number): Uint8Array {
  const outside = new Uint8Array(inside.length);
  const open: number[] = [];
  const visit = (x: number, y: number): void => {
    const at = y * side + x;
    if (x < 0 || y < 0 || x >= side || y >= side || inside[at] === 1 || outside[at] === 1) return;
    outside[at] = 1;
    open.push(at);
  };
  for (let k = 0; k < side; k++)
    for (const [x, y] of [
      [k, 0],
      [k, side - 1],
      [0, k],
      [side - 1, k],
    ] as const)
      visit(x, y);
  for (let at = open.pop(); at !== undefined; at = open.pop()) {
    const [x, y] = [at % side, Math.floor(at / side)];
    for (const [dx, dy] of [
      [1, 0],
      [-1, 0],
      [0, 1],
      [0, -1],
    ] as const)
      visit(x + dx, y + dy);
  }
  return outside;
}

/** Computes distances from the outside and from the border, in pixels, by a chamfer of two passes. */
function computeDistances(outside: Uint8Array, side: number): Float32Array {
  const distances = Float32Array.from(outside, (is) => (is === 1 ? 0 : Infinity));
  const at = (x: number, y: number): number => (x < 0 || y < 0 || x >= side || y >= side ? 0 : (distances[y * side + x] ?? 0));
  for (const step of [1, -1]) {
    for (let k = 0; k < distances.length; k++) {
      const index = step > 0 ? k : distances.length - 1 - k;
      const [x, y] = [index % side, Math.floor(index / side)];
      const near = Math.min(at(x - step, y), at(x, y - step)) + 1;
      const diagonal = Math.min(at(x - step, y - step), at(x + step, y - step)) + Math.SQRT2;
      distances[index] = Math.min(distances[index] ?? 0, near, diagonal);
    }
  }
  return distances;
}

type PixelCorner = readonly [column: number, row: number];

/** Index offsets to the pixels above, right, below and left, for rows of a width. */
export const stepsOf = (width: number): readonly number[] => [-width, 1, width, -1];

/** Simplification tolerance in pixels. A staircase of pixels becomes a line. */
const TOLERANCE_PX = 1.4;

/**
 * Traces the borders of a mask (rows of `width` pixels, 1 inside; pixels at the edge must be 0) as closed loops of pixel corners: clockwise, holes
 * counter-clockwise. Leaves out loops with fewer than three corners.
 */
export function loopsOf(mask: Uint8Array, width: number): PixelCorner[][] {
  const ways = bordersOf(mask, width);
  const loops: PixelCorner[][] = [];
  for (let at = 0; at < ways.length; at++) while (ways[at]) loops.push(simplifyLoop(followBorder(ways, at, width)));
  return loops.filter((loop) => loop.length > 2);
}

/** Returns, for each pixel's upper left corner, bits of the directions (in the order of `stepsOf`) in which a border continues with the mask on its right. */
function bordersOf(mask: Uint8Array, width: number): Uint8Array {
  const ways = new Uint8Array(mask.length);
  const corners = [width, 0, 1, width + 1];
  const beside = [-1, -width, 1, width];
  for (let at = 0; at < mask.length; at++) {
    if (mask[at])
      for (let way = 0; way < 4; way++)
        if (!mask[at + (beside[way] as number)]) (ways[at + (corners[way] as number)] as number) |= 1 << way;
  }
  return ways;
}

/** Follows a border and clears it. Turns right where two borders meet, so that pixels that only touch at a corner are separate. */
function followBorder(ways: Uint8Array, start: number, width: number): PixelCorner[] {
  const corners: PixelCorner[] = [];
  let [at, before] = [start, 0];
  do {
    const open = ways[at] as number;
    const way = [1, 0, 3, 2].map((turn) => (before + turn) % 4).find((one) => open & (1 << one)) as number;
    if (way !== before || at === start) corners.push([at % width, Math.floor(at / width)]);
    ways[at] = open & ~(1 << way);
    at += stepsOf(width)[way] as number;
    before = way;
  } while (at !== start);
  return corners;
}

/** Simplifies a loop by Douglas–Peucker, split at the corner farthest from the first. */
function simplifyLoop(loop: readonly PixelCorner[]): PixelCorner[] {
  const [first] = loop as [PixelCorner];
  const half = farthest(loop, (corner) => Math.hypot(corner[0] - first[0], corner[1] - first[1]));
  return [...simplifyLine(loop.slice(0, half + 1)), ...simplifyLine([...loop.slice(half), first])];
}

/** Simplifies a line. Omits the last corner. */
function simplifyLine(line: readonly PixelCorner[]): PixelCorner[] {
  const [a, b] = [line[0] as PixelCorner, line.at(-1) as PixelCorner];
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const area = ([x, y]: PixelCorner): number => Math.abs((x - a[0]) * dy - (y - a[1]) * dx);
  const half = farthest(line, area);
  if (area(line[half] as PixelCorner) <= TOLERANCE_PX * Math.hypot(dx, dy)) return [a];
  return [...simplifyLine(line.slice(0, half + 1)), ...simplifyLine(line.slice(half))];
}

const farthest = (line: readonly PixelCorner[], far: (corner: PixelCorner) => number): number =>
  line.reduce((best, corner, k) => (far(corner) > far(line[best] as PixelCorner) ? k : best), 0);

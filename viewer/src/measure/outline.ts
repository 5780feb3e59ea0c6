type Corner = readonly [column: number, row: number];

/** From a place in rows of so many to those above, right, below and left. */
export const stepsOf = (width: number): readonly number[] => [-width, 1, width, -1];

/** A corner may lie so far off the line that takes its place: pixels. A staircase of pixels becomes a line. */
const OFF_PX = 1.4;

/**
 * Borders of a mask (rows of `width` pixels, 1 for those that belong to it, none of them at its edge) as closed loops of pixel corners, clockwise, those
 * of holes the other way round; what is too thin for three corners is left out.
 */
export function loopsOf(mask: Uint8Array, width: number): Corner[][] {
  const ways = bordersOf(mask, width);
  const loops: Corner[][] = [];
  for (let at = 0; at < ways.length; at++) while (ways[at]) loops.push(simplified(walk(ways, at, width)));
  return loops.filter((loop) => loop.length > 2);
}

/** Bits of the ways (as of `stepsOf`) that borders take from each pixel's upper left corner, with the mask at the right hand. */
function bordersOf(mask: Uint8Array, width: number): Uint8Array {
  const ways = new Uint8Array(mask.length);
  const corners = [width, 0, 1, width + 1];
  const beside = [-1, -width, 1, width];
  for (let at = 0; at < mask.length; at++) {
    if (mask[at]) for (let way = 0; way < 4; way++) if (!mask[at + (beside[way] as number)]) (ways[at + (corners[way] as number)] as number) |= 1 << way;
  }
  return ways;
}

/** Goes round a border and takes it away; where two meet, to the right, so that pixels which touch at a corner are apart. */
function walk(ways: Uint8Array, start: number, width: number): Corner[] {
  const corners: Corner[] = [];
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

/** After Douglas and Peucker, from the corner that is farthest from the first. */
function simplified(loop: readonly Corner[]): Corner[] {
  const [first] = loop as [Corner];
  const half = farthest(loop, (corner) => Math.hypot(corner[0] - first[0], corner[1] - first[1]));
  return [...thinned(loop.slice(0, half + 1)), ...thinned([...loop.slice(half), first])];
}

/** Without the last corner. */
function thinned(line: readonly Corner[]): Corner[] {
  const [a, b] = [line[0] as Corner, line.at(-1) as Corner];
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const off = ([x, y]: Corner): number => Math.abs((x - a[0]) * dy - (y - a[1]) * dx);
  const half = farthest(line, off);
  if (off(line[half] as Corner) <= OFF_PX * Math.hypot(dx, dy)) return [a];
  return [...thinned(line.slice(0, half + 1)), ...thinned(line.slice(half))];
}

const farthest = (line: readonly Corner[], far: (corner: Corner) => number): number => line.reduce((best, corner, k) => (far(corner) > far(line[best] as Corner) ? k : best), 0);

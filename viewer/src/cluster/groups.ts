/** Markers that form one cluster; the first member is its seed. */
export interface MarkerGroup {
  readonly members: readonly number[];
  /** Mean of the members, in U and V. */
  readonly u: number;
  readonly v: number;
}

/**
 * Groups points greedily: each ungrouped point, in order, becomes the seed of a group of all ungrouped points within the radius. The result is deterministic:
 * seeds are farther apart than the radius, and every member is within the radius of its seed.
 * @param uv U and V of each point, interleaved
 */
export function groupPoints(uv: Float64Array, radius: number): MarkerGroup[] {
  const cells = cellsOf(uv, radius);
  const taken = new Uint8Array(uv.length / 2);
  const groups: MarkerGroup[] = [];
  for (let k = 0; k < taken.length; k++) {
    if (taken[k]) continue;
    const members = pointsNear(uv, cells, k, radius).filter((other) => !taken[other]);
    for (const member of members) taken[member] = 1;
    const mean = (axis: 0 | 1): number => members.reduce((sum, member) => sum + (uv[2 * member + axis] as number), 0) / members.length;
    groups.push({ members, u: mean(0), v: mean(1) });
  }
  return groups;
}

type Cells = ReadonlyMap<number, readonly number[]>;

const cellOf = (value: number, radius: number): number => Math.floor(value / radius);
/** Keys collide only for cells far outside any scene; a collision costs time, not correctness. */
const keyOf = (x: number, y: number): number => x * 2 ** 26 + y;

function cellsOf(uv: Float64Array, radius: number): Cells {
  const cells = new Map<number, number[]>();
  for (let k = 0; 2 * k < uv.length; k++) {
    const key = keyOf(cellOf(uv[2 * k] as number, radius), cellOf(uv[2 * k + 1] as number, radius));
    const cell = cells.get(key);
    if (cell) cell.push(k);
    else cells.set(key, [k]);
  }
  return cells;
}

/** Returns the point itself, then its neighbours in order. */
function pointsNear(uv: Float64Array, cells: Cells, at: number, radius: number): number[] {
  const [u, v] = [uv[2 * at] as number, uv[2 * at + 1] as number];
  const neighbours: number[] = [];
  for (let x = cellOf(u, radius) - 1; x <= cellOf(u, radius) + 1; x++) {
    for (let y = cellOf(v, radius) - 1; y <= cellOf(v, radius) + 1; y++) {
      for (const other of cells.get(keyOf(x, y)) ?? [])
        if (other !== at && Math.hypot((uv[2 * other] as number) - u, (uv[2 * other + 1] as number) - v) <= radius) neighbours.push(other);
    }
  }
  return [at, ...neighbours.sort((a, b) => a - b)];
}

/** Returns offsets around a centre at which items of a size do not overlap, in pixels: a circle for up to eight items, else a spiral. */
export function spiderOffsets(count: number, size: number): [number, number][] {
  if (count <= 8) {
    const radius = Math.max((count * size) / (2 * Math.PI), size);
    return Array.from({ length: count }, (_, k) => polar(radius, (2 * Math.PI * k) / count - Math.PI / 2));
  }
  let [angle, radius] = [-Math.PI / 2, 1.3 * size];
  return Array.from({ length: count }, () => {
    const offset = polar(radius, angle);
    const step = size / radius;
    angle += step;
    radius += (size * step) / (2 * Math.PI);
    return offset;
  });
}

const polar = (radius: number, angle: number): [number, number] => [radius * Math.cos(angle), radius * Math.sin(angle)];

/** Points that lie together: the first is the one they lie around. */
export interface Group {
  readonly members: readonly number[];
  /** Middle of the members. */
  readonly u: number;
  readonly v: number;
}

/**
 * Groups of points: each point that no group has yet, in order, takes those within the radius around it that have none either. The same points give the same groups;
 * first members lie farther apart than the radius, and every member lies within it of its first.
 * @param uv U and V in turn
 */
export function groupsOf(uv: Float64Array, radius: number): Group[] {
  const cells = sorted(uv, radius);
  const taken = new Uint8Array(uv.length / 2);
  const groups: Group[] = [];
  for (let k = 0; k < taken.length; k++) {
    if (taken[k]) continue;
    const members = near(uv, cells, k, radius).filter((other) => !taken[other]);
    for (const member of members) taken[member] = 1;
    const mean = (axis: 0 | 1): number => members.reduce((sum, member) => sum + (uv[2 * member + axis] as number), 0) / members.length;
    groups.push({ members, u: mean(0), v: mean(1) });
  }
  return groups;
}

type Cells = ReadonlyMap<number, readonly number[]>;

const cellOf = (value: number, radius: number): number => Math.floor(value / radius);
/** Cells far beyond any scene share keys, which only costs time. */
const keyOf = (x: number, y: number): number => x * 2 ** 26 + y;

function sorted(uv: Float64Array, radius: number): Cells {
  const cells = new Map<number, number[]>();
  for (let k = 0; 2 * k < uv.length; k++) {
    const key = keyOf(cellOf(uv[2 * k] as number, radius), cellOf(uv[2 * k + 1] as number, radius));
    const cell = cells.get(key);
    if (cell) cell.push(k);
    else cells.set(key, [k]);
  }
  return cells;
}

/** The point itself, then those around it, in order. */
function near(uv: Float64Array, cells: Cells, at: number, radius: number): number[] {
  const [u, v] = [uv[2 * at] as number, uv[2 * at + 1] as number];
  const found: number[] = [];
  for (let x = cellOf(u, radius) - 1; x <= cellOf(u, radius) + 1; x++) {
    for (let y = cellOf(v, radius) - 1; y <= cellOf(v, radius) + 1; y++) {
      for (const other of cells.get(keyOf(x, y)) ?? []) if (other !== at && Math.hypot((uv[2 * other] as number) - u, (uv[2 * other + 1] as number) - v) <= radius) found.push(other);
    }
  }
  return [at, ...found.sort((a, b) => a - b)];
}

/** Places around a middle for things of a size, in pixels: a circle for few, a spiral for many. */
export function spread(count: number, size: number): [number, number][] {
  if (count <= 8) {
    const radius = Math.max((count * size) / (2 * Math.PI), size);
    return Array.from({ length: count }, (_, k) => turned(radius, (2 * Math.PI * k) / count - Math.PI / 2));
  }
  let [angle, radius] = [-Math.PI / 2, 1.3 * size];
  return Array.from({ length: count }, () => {
    const place = turned(radius, angle);
    const step = size / radius;
    angle += step;
    radius += (size * step) / (2 * Math.PI);
    return place;
  });
}

const turned = (radius: number, angle: number): [number, number] => [radius * Math.cos(angle), radius * Math.sin(angle)];

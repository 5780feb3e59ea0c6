import { describe, expect, test } from "vitest";
import { groupPoints, spiderOffsets } from "../../src/cluster/groups";

function points(count: number, side: number, seed = 3): Float64Array {
  let state = seed;
  return Float64Array.from({ length: 2 * count }, () => ((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32 - 0.5) * side);
}

describe("groups", () => {
  test.each([
    [1, 10],
    [500, 10],
    [500, 60],
    [500, 1e6],
    [3000, 3],
  ])(
    "%d points with radius %d: groups are a partition, members are within the radius of their seed, seeds are farther apart",
    (count, radius) => {
      const uv = points(count, 1000);
      const groups = groupPoints(uv, radius);
      const apart = (a: number, b: number): number =>
        Math.hypot((uv[2 * a] as number) - (uv[2 * b] as number), (uv[2 * a + 1] as number) - (uv[2 * b + 1] as number));
      expect(groups.flatMap(({ members }) => members).sort((a, b) => a - b)).toEqual(Array.from({ length: count }, (_, k) => k));
      const firsts = groups.map(({ members }) => members[0] as number);
      for (const { members } of groups)
        for (const member of members) expect(apart(members[0] as number, member)).toBeLessThanOrEqual(radius);
      for (const [k, a] of firsts.slice(0, 400).entries()) for (const b of firsts.slice(0, k)) expect(apart(a, b)).toBeGreaterThan(radius);
      expect(groupPoints(uv, radius)).toEqual(groups);
    },
  );

  test("moving all points moves the groups without changing their members", () => {
    const uv = points(400, 1000);
    const members = (list: Float64Array): unknown => groupPoints(list, 50).map((group) => group.members);
    expect(members(uv.map((value) => value + 1234.5))).toEqual(members(uv));
  });

  test("no points, and all points at one position", () => {
    expect(groupPoints(new Float64Array(), 5)).toEqual([]);
    expect(groupPoints(new Float64Array(200).fill(7), 5)).toMatchObject([{ u: 7, v: 7 }]);
  });
});

test.each([2, 8, 9, 60])("%d spread markers do not overlap", (count) => {
  const places = spiderOffsets(count, 48);
  for (const [k, a] of places.entries())
    for (const b of places.slice(0, k)) expect(Math.hypot(a[0] - b[0], a[1] - b[1])).toBeGreaterThan(40);
});

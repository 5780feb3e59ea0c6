import { describe, expect, test } from "vitest";
import type { Vec3 } from "../../src/core/vec";
import { uvdFromLocal } from "../../src/geo/axes";
import { samplePoints, heightAt } from "../../src/measure/profile";
import { BOX, framesOf, THINGS, trace } from "../fixture/town";

const PX = 0.2;

describe("profile heights agree with rays of every pixel", () => {
  test.each([
    [0, 45],
    [45, 22.5],
    [180, 60],
    [90, 90],
  ])("looking %d° at %d°: only the visible surface", (lookAt, pitch) => {
    const [frame] = framesOf(BOX, 256, PX, [[lookAt, pitch]]).frames;
    if (!frame) throw new Error("no frame");
    const middle = (at: number): number => (Math.floor(at / PX) + 0.5) * PX;
    const depthAt = (u: number, v: number): number => {
      const hit = trace(frame, middle(u), middle(v));
      return hit ? frame.d0 + hit.d : Infinity;
    };
    const counts = { known: 0, hidden: 0 };
    for (let k = 0; k < 400; k++) {
      const [x, y] = [-95 + ((k * 37.7) % 190), -75 + ((k * 61.3) % 150)];
      // The model's own height, and whether a ray reaches it.
      const tops = THINGS.filter(({ box: [lo, hi] }) => x > lo[0] && x < hi[0] && y > lo[1] && y < hi[1]).map(({ box }) => box[1][2]);
      const top = Math.max(...tops);
      const edge = THINGS.some(
        ({ box: [lo, hi] }) =>
          [lo[0], hi[0]].some((side) => Math.abs(x - side) < 1.5) || [lo[1], hi[1]].some((side) => Math.abs(y - side) < 1.5),
      );
      if (edge) continue;
      const [u, v, d] = uvdFromLocal(frame.axes, [x, y, top]);
      const around = [
        [0, 0],
        [0.8, 0],
        [-0.8, 0],
        [0, 0.8],
        [0, -0.8],
      ].map(([du = 0, dv = 0]) => depthAt(u + du, v + dv) - d);
      const found = heightAt({ depthAt, pixel_m: PX }, frame.axes, [x, y, 0] as Vec3, [BOX[0][2], BOX[1][2]]);
      if (around.every((behind) => behind > -2.5)) {
        counts.known++;
        expect(Math.abs(found - top)).toBeLessThan(2 * PX);
      } else if (around.every((behind) => behind < -2.5)) {
        counts.hidden++;
        // Hidden from above; further down, the vertical can be visible only inside objects, which no ray sees.
        expect(found).toBeNaN();
      }
    }
    expect(counts.known).toBeGreaterThan(150);
    if (pitch < 90) expect(counts.hidden).toBeGreaterThan(3);
  });
});

test("samples are at equal distances, including the ends", () => {
  const places = samplePoints(
    [
      [0, 0, 5],
      [30, 0, 9],
      [30, 40, 1],
    ],
    8,
  );
  expect(places.map(({ distance_m }) => distance_m)).toEqual([0, 10, 20, 30, 40, 50, 60, 70]);
  expect(places.map(({ position: [x, y] }) => [x, y])).toEqual([
    [0, 0],
    [10, 0],
    [20, 0],
    [30, 0],
    [30, 10],
    [30, 20],
    [30, 30],
    [30, 40],
  ]);
  expect(
    samplePoints(
      [
        [1, 1, 1],
        [1, 1, 4],
      ],
      3,
    ).map(({ position: [x, y] }) => [x, y]),
  ).toEqual([
    [1, 1],
    [1, 1],
    [1, 1],
  ]);
  expect(samplePoints([[0, 0, 0]], 5)).toEqual([]);
});

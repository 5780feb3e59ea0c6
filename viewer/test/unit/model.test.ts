import { describe, expect, test } from "vitest";
import type { Box3 } from "../../src/core/vec";
import { screenFromLocal, type Camera } from "../../src/geo/camera";
import { DEFAULT_LIGHT, towardsLight } from "../../src/geo/light";
import { depthRangeOf, screenRectCorner, threeLighting, screenRectOf } from "../../src/model/projection";
import { BOX, framesOf } from "../fixture/town";

const frame = framesOf(BOX, 128, 0.38, [[0, 45]]).frames[0] as Camera["frame"];
const CAMERA: Camera = { frame, u: 0, v: 0, zoom: 3, width: 500, height: 400 };
const HOUSE: Box3 = [
  [-5, -5, 0],
  [5, 5, 10],
];

describe("a part of the screen", () => {
  test.each([1, 1.5, 3])("contains the boxes at %d device pixels per CSS pixel", (dpr) => {
    const screen = { camera: CAMERA, width: 500 * dpr, height: 400 * dpr, dpr };
    const part = screenRectOf([HOUSE], screen);
    if (!part) throw new Error("nothing is seen");
    expect([part.x, part.y, part.width, part.height].every(Number.isInteger)).toBe(true);
    for (const corner of HOUSE) {
      const [x, y] = screenFromLocal(CAMERA, corner).map((at) => at * dpr) as [number, number];
      expect(x > part.x && x < part.x + part.width && y > part.y && y < part.y + part.height).toBe(true);
    }
    const [u, v, px] = screenRectCorner(part, screen);
    expect(u).toBeCloseTo((part.x - 250 * dpr) * px, 9);
    expect(v).toBeCloseTo((200 * dpr - part.y) * px, 9);
  });

  test("is clipped to the screen, and null out of view", () => {
    const screen = { camera: CAMERA, width: 500, height: 400, dpr: 1 };
    const all = screenRectOf(
      [
        [
          [-1e4, -1e4, -1e4],
          [1e4, 1e4, 1e4],
        ],
      ],
      screen,
    );
    expect(all).toEqual({ x: 0, y: 0, width: 500, height: 400 });
    const edge = screenRectOf(
      [
        [
          [90, -5, 0],
          [200, 5, 10],
        ],
      ],
      screen,
    );
    expect(edge && edge.x + edge.width).toBe(500);
    expect(
      screenRectOf(
        [
          [
            [300, 0, 0],
            [310, 10, 10],
          ],
        ],
        screen,
      ),
    ).toBe(null);
    expect(screenRectOf([], screen)).toBe(null);
  });

  test("keeps its size during small movements", () => {
    const sizes = [0, 1, 2.5].map((x) => {
      const { width, height } =
        screenRectOf(
          [
            [
              [x - 5, -5, 0],
              [x + 5, 5, 10],
            ],
          ],
          { camera: CAMERA, width: 500, height: 400, dpr: 1 },
        ) ?? {};
      return `${String(width)} ${String(height)}`;
    });
    expect(new Set(sizes).size).toBe(1);
  });
});

test("the depth range of boxes is that of their corners", () => {
  const half = Math.SQRT1_2;
  const [near, far] = depthRangeOf([HOUSE], frame) ?? [0, 0];
  expect(near).toBeCloseTo(half * (-5 - 10), 9);
  expect(far).toBeCloseTo(half * 5, 9);
  expect(depthRangeOf([], frame)).toBe(null);
});

test("three.js lights are π times the map's light; unlit, uniform white", () => {
  const lamps = threeLighting({ ...DEFAULT_LIGHT, sun_rgb: [1, 0.5, 0.2] });
  expect(lamps).toEqual({
    sky_rgb: [1, 1, 1],
    sky: Math.PI * 0.42,
    sun_rgb: [1, 0.5, 0.2],
    sun: Math.PI * 0.76,
    towards: towardsLight(DEFAULT_LIGHT),
  });
  expect(threeLighting({ ...DEFAULT_LIGHT, sky_rgb: [0, 0, 1], lit: false })).toMatchObject({ sky_rgb: [1, 1, 1], sky: Math.PI, sun: 0 });
});

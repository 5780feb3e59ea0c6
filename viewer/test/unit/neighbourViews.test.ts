import { expect, test } from "vitest";
import type { Rendering } from "../../src/geo/manifest";
import { findNeighbourView, findTiltedView } from "../../src/map/neighbourViews";
import { floorToRound } from "../../src/core/lengths";

const VIEWS = [
  [0, 30],
  [90, 30],
  [180, 30],
  [270, 30],
  [0, 60],
  [180, 60],
  [0, 90],
] as const;
const views = new Map(
  VIEWS.map(([lookAt_deg, pitch_deg]) => [
    `${String(lookAt_deg)}-${String(pitch_deg)}`,
    { frame: { id: `${String(lookAt_deg)}-${String(pitch_deg)}`, lookAt_deg, pitch_deg } },
  ]),
);
const rendering = { views } as unknown as Rendering;
const frame = (id: string): Parameters<typeof findTiltedView>[1] =>
  (rendering.views.get(id) as unknown as { frame: Parameters<typeof findTiltedView>[1] }).frame;

test("rotating cycles through the views of one pitch", () => {
  expect(findNeighbourView(rendering, frame("270-30"), 1)).toBe("0-30");
  expect(findNeighbourView(rendering, frame("0-30"), -1)).toBe("270-30");
  expect(findNeighbourView(rendering, frame("0-60"), 1)).toBe("180-60");
  expect(findNeighbourView(rendering, frame("0-90"), 1)).toBe("0-90");
});

test("tilting switches to the next pitch in the nearest direction", () => {
  expect(findTiltedView(rendering, frame("270-30"), 1)).toMatch(/^(0|180)-60$/);
  expect(findTiltedView(rendering, frame("180-30"), 1)).toBe("180-60");
  expect(findTiltedView(rendering, frame("180-60"), 1)).toBe("0-90");
  expect(findTiltedView(rendering, frame("180-60"), -1)).toBe("180-30");
  expect(findTiltedView(rendering, frame("0-90"), 1)).toBeNull();
  expect(findTiltedView(rendering, frame("90-30"), -1)).toBeNull();
});

test.each([
  [110, 100],
  [99, 50],
  [49, 20],
  [19.9, 10],
  [5, 5],
  [0.3, 0.2],
  [1, 1],
])("%d rounds down to %d", (value, round) => {
  expect(floorToRound(value)).toBeCloseTo(round, 12);
});

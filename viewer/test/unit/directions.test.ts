import { expect, test } from "vitest";
import type { Rendering } from "../../src/geo/manifest";
import { neighbourView, tiltedView } from "../../src/map/directions";
import { floorToRound } from "../../src/core/lengths";

const VIEWS = [[0, 30], [90, 30], [180, 30], [270, 30], [0, 60], [180, 60], [0, 90]] as const;
const views = new Map(VIEWS.map(([lookAtDeg, pitchDeg]) => [`${String(lookAtDeg)}-${String(pitchDeg)}`, { frame: { id: `${String(lookAtDeg)}-${String(pitchDeg)}`, lookAtDeg, pitchDeg } }]));
const rendering = { views } as unknown as Rendering;
const frame = (id: string): Parameters<typeof tiltedView>[1] => (rendering.views.get(id) as unknown as { frame: Parameters<typeof tiltedView>[1] }).frame;

test("turning goes round among the views of one pitch", () => {
  expect(neighbourView(rendering, frame("270-30"), 1)).toBe("0-30");
  expect(neighbourView(rendering, frame("0-30"), -1)).toBe("270-30");
  expect(neighbourView(rendering, frame("0-60"), 1)).toBe("180-60");
  expect(neighbourView(rendering, frame("0-90"), 1)).toBe("0-90");
});

test("tilting takes the next pitch, in the nearest direction that has it", () => {
  expect(tiltedView(rendering, frame("270-30"), 1)).toMatch(/^(0|180)-60$/);
  expect(tiltedView(rendering, frame("180-30"), 1)).toBe("180-60");
  expect(tiltedView(rendering, frame("180-60"), 1)).toBe("0-90");
  expect(tiltedView(rendering, frame("180-60"), -1)).toBe("180-30");
  expect(tiltedView(rendering, frame("0-90"), 1)).toBeNull();
  expect(tiltedView(rendering, frame("90-30"), -1)).toBeNull();
});

test.each([[110, 100], [99, 50], [49, 20], [19.9, 10], [5, 5], [0.3, 0.2], [1, 1]])("below %d the round number is %d", (value, round) => {
  expect(floorToRound(value)).toBeCloseTo(round, 12);
});

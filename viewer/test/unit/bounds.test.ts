import { describe, expect, test } from "vitest";
import { makeFrame } from "../../src/geo/frame";
import type { Camera } from "../../src/geo/camera";
import { computeZoomLimits, limitCamera, panSoftly, type Limits } from "../../src/map/limits";
import { Motion } from "../../src/map/motion";

const frame = makeFrame({ id: "0-90", look_at_deg: 0, pitch_deg: 90, u0_m: -512, v0_m: 512, d0_m: -1000 }, 1024, 256, 4);
const camera: Camera = { frame, u: 0, v: 0, zoom: 2, width: 800, height: 600 }; // a metre per CSS pixel
const limits: Limits = {
  box: [
    [-100, -50, 0],
    [100, 50, 10],
  ],
  bounds: [
    [-100, -50, 0],
    [100, 50, 10],
  ],
  minZoom: undefined,
  maxZoom: undefined,
};

describe("zoom limits", () => {
  test("follow the content and the deepest level", () => {
    const [least, most] = computeZoomLimits(camera, limits);
    expect(most).toBe(6);
    expect(least).toBeCloseTo(Math.log2(4) + Math.log2(800 / 200) - 1.2, 6);
  });

  test("can be set, also beyond those of the content", () => {
    expect(computeZoomLimits(camera, { ...limits, minZoom: 1, maxZoom: 8 })).toEqual([1, 8]);
    expect(computeZoomLimits(camera, { ...limits, maxZoom: 2 })).toEqual([2, 2]);
    expect(computeZoomLimits(camera, { ...limits, minZoom: 7 })).toEqual([7, 7]);
    expect(limitCamera({ ...camera, zoom: 0 }, { ...limits, minZoom: 3.5 }).zoom).toBe(3.5);
  });
});

describe("bounds", () => {
  test("keep the centre of the screen inside", () => {
    const { u, v } = limitCamera({ ...camera, u: 500, v: -500 }, limits);
    expect([u, v]).toEqual([100, -50]);
  });

  test("a drag inside moves the picture by as much; beyond, with growing resistance, by at most a quarter of the screen", () => {
    let at = panSoftly(camera, -30, 20, limits);
    expect([at.u, at.v]).toEqual([30, 20]);
    const steps: number[] = [];
    for (let k = 0; k < 100; k++) {
      const next = panSoftly(at, -30, 0, limits);
      if (at.u >= 100) steps.push(next.u - at.u);
      at = next;
    }
    expect(at.u).toBeGreaterThan(200);
    expect(at.u).toBeLessThanOrEqual(300);
    for (let k = 1; k < steps.length; k++) expect(steps[k]).toBeLessThanOrEqual((steps[k - 1] ?? 0) + 1e-9);
    expect(panSoftly(at, 30, 0, limits).u).toBeCloseTo(at.u - 30, 9); // back without resistance
  });

  test.each([[[0, 0]], [[-2, -0.5]]])(
    "after a drag beyond, with a velocity of %j, the picture springs back and rests at the edge",
    (velocity) => {
      const motion = new Motion(
        () => undefined,
        (each) => limitCamera(each, limits),
      );
      let at: Camera = { ...camera, u: 180, v: -80 };
      motion.startInertia(velocity as [number, number], (each, dx, dy) => panSoftly(each, dx, dy, limits));
      const start = performance.now();
      const path: number[] = [];
      for (let k = 1; motion.moving && k < 400; k++) {
        at = motion.step(start + 16 * k, at);
        path.push(at.u);
      }
      expect(motion.moving).toBe(false);
      expect(path.length).toBeGreaterThan(10);
      expect(path.length).toBeLessThan(120);
      expect([at.u, at.v]).toEqual([100, -50]);
      expect(Math.max(...path)).toBeLessThanOrEqual(300);
    },
  );
});

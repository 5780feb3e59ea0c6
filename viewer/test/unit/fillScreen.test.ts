import { describe, expect, test } from "vitest";
import { depthAtHeight, localFromUvd } from "../../src/geo/axes";
import { projectedBox, uvFromScreen, zoomToFit, type Camera } from "../../src/geo/camera";
import { makeFrame, type Tile } from "../../src/geo/frame";
import type { View } from "../../src/geo/manifest";
import type { Box3 } from "../../src/core/vec";
import { fillScreen } from "../../src/map/limits";

const LAND: Box3 = [
  [0, 0, 0],
  [400, 300, 30],
];

/** A view of a box, all tiles of which are occupied unless told, and a camera that shows the whole box. */
function whole(
  box: Box3,
  lookAt: number,
  pitch: number,
  [width, height]: readonly [number, number],
  occupied: (tile: Tile) => boolean = () => true,
): { camera: Camera; view: View } {
  const frame = makeFrame({ id: "view", look_at_deg: lookAt, pitch_deg: pitch, u0_m: -1024, v0_m: 1024, d0_m: -1000 }, 2048, 256, 5);
  const [low, high] = projectedBox(frame, box);
  const camera = { frame, u: (low[0] + high[0]) / 2, v: (low[1] + high[1]) / 2, zoom: 0, width, height };
  return {
    camera: { ...camera, zoom: zoomToFit(camera, high[0] - low[0], high[1] - low[1], 0) },
    view: { frame, occupancy: { has: occupied } } as unknown as View,
  };
}

/** Fraction of the screen whose ground is in the box. */
function filled(camera: Camera, [low, high]: Box3): number {
  const { axes } = camera.frame;
  let inside = 0;
  for (let k = 0; k < 10_000; k++) {
    const [u, v] = uvFromScreen(camera, [((k % 100) + 0.5) * (camera.width / 100), (Math.floor(k / 100) + 0.5) * (camera.height / 100)]);
    const [x, y] = localFromUvd(axes, [u, v, depthAtHeight(axes, v, low[2]) ?? NaN]);
    if (x >= low[0] && x <= high[0] && y >= low[1] && y <= high[1]) inside++;
  }
  return inside / 10_000;
}

describe("the first picture", () => {
  test.each([
    [0, 45, [1280, 800]],
    [0, 45, [390, 844]],
    [45, 45, [1280, 800]],
    [45, 22.5, [1280, 800]],
    [22.5, 60, [390, 844]],
    [90, 90, [800, 600]],
  ] as const)("of a landscape at %d/%d fills a screen of %j, and no more than that", (lookAt, pitch, size) => {
    const { camera, view } = whole(LAND, lookAt, pitch, size);
    const larger = fillScreen(camera, view, LAND);
    expect(filled(larger, LAND)).toBeGreaterThan(0.95);
    expect(filled({ ...larger, zoom: larger.zoom - 0.25 }, LAND)).toBeLessThan(0.995);
    expect(larger.zoom - camera.zoom).toBeLessThanOrEqual(3);
  });

  test("of an object that is high for its width shows all of it", () => {
    const tower: Box3 = [
      [0, 0, 0],
      [20, 20, 60],
    ];
    const { camera, view } = whole(tower, 0, 45, [800, 600]);
    expect(fillScreen(camera, view, tower)).toBe(camera);
  });

  test("of content in pieces that never fill a screen shows all of it", () => {
    const { camera, view } = whole(LAND, 0, 45, [800, 600], ({ x, y }) => (x + y) % 2 === 0);
    expect(fillScreen(camera, view, LAND)).toBe(camera);
  });

  test("keeps to where there are tiles", () => {
    const east = ({ x }: Tile): boolean => x >= 20; // from U = 256 m on, in tiles of 64 m
    const { camera, view } = whole(LAND, 0, 45, [800, 600], east);
    expect(fillScreen(camera, view, LAND)).toBe(camera); // the middle of the box, U = 200 m, shows nothing
  });

  test("of a level view is measured by its tiles alone", () => {
    const { camera, view } = whole(LAND, 0, 0, [800, 600], ({ y }) => y >= 10);
    expect(fillScreen(camera, view, LAND).zoom).toBeGreaterThanOrEqual(camera.zoom);
  });
});

import type { Global } from "../browser/page";
import type { Driver, Screenshot } from "./driver";
import { HEIGHT, WIDTH } from "./page";

/** Actions on a map, one after another, each followed by a screenshot. */
const scenes: readonly (readonly [name: string, act: (plan: string) => unknown])[] = [
  ["lit", () => (globalThis as Global).map.setLight({})],
  ["low sun", () => (globalThis as Global).map.setLight({ azimuth_deg: 250, elevation_deg: 12, sun_rgb: [1, 0.7, 0.45] })],
  ["normal", () => (globalThis as Global).layer.setMode("normal")],
  ["id", () => (globalThis as Global).layer.setMode("id")],
  ["depth", () => (globalThis as Global).layer.setMode("depth")],
  ["color", () => (globalThis as Global).layer.setMode("color")],
  ["highlight", () => (globalThis as Global).layer.setMode("lit").highlight([17, 3_900_000_007], { color: "#1389a0" })],
  ["two layers", (plan) => new (globalThis as Global).map3d.imageLayer(plan).addTo((globalThis as Global).map)],
  ["turned", () => (globalThis as Global).map.setDirection("90-45")],
  ["between", () => (globalThis as Global).map.setZoom(2.6)],
];

/** Takes screenshots of all scenes. @param plan address of the second layer */
export async function takeScreenshots(driver: Driver, plan: string): Promise<Map<string, Screenshot>> {
  const found = new Map<string, Screenshot>();
  for (const [name, act] of scenes) {
    await driver.settled(act, plan);
    found.set(name, await driver.shot());
  }
  return found;
}

/** Difference between the RGB bytes of two maps. */
export interface Difference {
  readonly most: number;
  /** Fraction of pixels with a byte that differs by more than 2. */
  readonly off: number;
}

export function difference(a: Screenshot, b: Screenshot): Difference {
  let [most, off] = [0, 0];
  for (let p = 0; p < WIDTH * HEIGHT; p++) {
    const [x, y] = [p % WIDTH, Math.floor(p / WIDTH)];
    const apart = Math.max(
      ...[0, 1, 2].map((k) => Math.abs((a.rgb[3 * (y * a.width + x) + k] ?? 0) - (b.rgb[3 * (y * b.width + x) + k] ?? 0))),
    );
    most = Math.max(most, apart);
    if (apart > 2) off++;
  }
  return { most, off: off / (WIDTH * HEIGHT) };
}

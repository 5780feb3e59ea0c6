import { expect, test } from "vitest";
import { clearBox, computeHaze } from "../../page/hazeMask";
import type { Vec3 } from "../../src/core/vec";
import { uvdFromLocal } from "../../src/geo/axes";
import { makeFrame } from "../../src/geo/frame";

const SIDE = 64;
const grid = (isInside: (x: number, y: number) => boolean): Uint8Array =>
  Uint8Array.from({ length: SIDE * SIDE }, (_, k) => (isInside(k % SIDE, Math.floor(k / SIDE)) ? 1 : 0));
const square = (x: number, y: number): boolean => x >= 8 && x < 56 && y >= 8 && y < 56;

test("the haze is full outside the content and at its edge, none in the middle, and decreases inwards", () => {
  const haze = computeHaze(grid(square), SIDE) ?? new Uint8ClampedArray();
  const row = Array.from({ length: 32 }, (_, x) => haze[32 * SIDE + x] ?? -1);
  expect(row.slice(0, 9)).toEqual(new Array(9).fill(255));
  expect(row.slice(16)).toEqual(new Array(16).fill(0));
  row.slice(1).forEach((value, k) => {
    expect(value).toBeLessThanOrEqual(row[k] ?? 0);
  });
  expect(haze[8 * SIDE + 8]).toBe(255);
});

test("a hole in the content has no haze", () => {
  const haze = computeHaze(
    grid((x, y) => square(x, y) && !(Math.abs(x - 32) < 3 && Math.abs(y - 32) < 3)),
    SIDE,
  );
  expect(haze?.[32 * SIDE + 32]).toBe(0);
  expect(haze?.[32 * SIDE + 28]).toBe(0);
});

test("content up to the border fades there, too; narrow content has no haze", () => {
  expect(
    computeHaze(
      grid(() => true),
      SIDE,
    )?.[0],
  ).toBe(255);
  expect(
    computeHaze(
      grid((x) => x % 8 < 4),
      SIDE,
    ),
  ).toBeNull();
  expect(
    computeHaze(
      grid(() => false),
      SIDE,
    ),
  ).toBeNull();
});

test("a tower that rises above the edge has no haze, nor has the ground at its foot", () => {
  const low = (x: number, y: number): boolean => x >= 8 && x < 56 && y >= 24 && y < 56;
  const tower = (x: number, y: number): boolean => Math.abs(x - 40) < 2 && y >= 10 && y < 32;
  const haze =
    computeHaze(
      grid((x, y) => low(x, y) || tower(x, y)),
      SIDE,
    ) ?? new Uint8ClampedArray();
  for (let y = 10; y < 32; y++) expect(haze[y * SIDE + 40]).toBe(0);
  expect(haze[24 * SIDE + 20]).toBe(255);
});

test("the upper edges of a diamond fade", () => {
  const haze =
    computeHaze(
      grid((x, y) => Math.abs(x - 32) + Math.abs(y - 32) < 24),
      SIDE,
    ) ?? new Uint8ClampedArray();
  for (const x of [18, 22, 42, 46]) expect(haze[(32 - 23 + Math.abs(x - 32)) * SIDE + x]).toBe(255);
});

test("a corner that is higher than the rest of the upper edge fades, and so does the side below it", () => {
  const haze =
    computeHaze(
      grid((x, y) => x >= 8 && x < 56 && y >= (x < 13 ? 8 : 9) && y < 56),
      SIDE,
    ) ?? new Uint8ClampedArray();
  for (let y = 8; y < 56; y++) expect(haze[y * SIDE + 8]).toBe(255);
  for (let x = 8; x < 56; x++) expect(haze[9 * SIDE + x]).toBeGreaterThan(150);
});

test("the upper corner of a diamond fades", () => {
  const haze =
    computeHaze(
      grid((x, y) => Math.abs(x - 32) + Math.abs(y - 32) < 24),
      SIDE,
    ) ?? new Uint8ClampedArray();
  expect(haze[9 * SIDE + 32]).toBe(255);
  expect(haze[12 * SIDE + 32]).toBeGreaterThan(0);
});

test("a tower at a corner has no haze, but the side below it fades", () => {
  const haze =
    computeHaze(
      grid((x, y) => x >= 8 && x < 56 && y >= (x < 12 ? 10 : 24) && y < 56),
      SIDE,
    ) ?? new Uint8ClampedArray();
  expect(haze[14 * SIDE + 10]).toBe(0);
  expect(haze[48 * SIDE + 8]).toBe(255);
});

test("a broad low tower with a spire on one side has no haze", () => {
  const low = (x: number, y: number): boolean => x >= 4 && x < 60 && y >= 24 && y < 60;
  const tower = (x: number, y: number): boolean => (x >= 40 && x < 46 && y >= 19 && y < 30) || (x >= 41 && x < 43 && y >= 10 && y < 30);
  const haze =
    computeHaze(
      grid((x, y) => low(x, y) || tower(x, y)),
      SIDE,
    ) ?? new Uint8ClampedArray();
  for (let x = 40; x < 46; x++) for (let y = 19; y < 26; y++) expect(haze[y * SIDE + x], `${String(x)}, ${String(y)}`).toBe(0);
  expect([haze[12 * SIDE + 41], haze[24 * SIDE + 30], haze[24 * SIDE + 52]]).toEqual([0, 255, 255]);
});

test("haze veils no object, in any view", () => {
  const box = [
    [100, 100, 0],
    [300, 200, 40],
  ] as const;
  for (const [lookAt, pitch] of [
    [0, 45],
    [45, 22.5],
    [200, 60],
    [0, 90],
  ] as const) {
    const frame = makeFrame({ id: "view", look_at_deg: lookAt, pitch_deg: pitch, u0_m: -512, v0_m: 512, d0_m: -1000 }, 1024, 256, 5);
    const haze = new Uint8ClampedArray(128 * 128).fill(255);
    clearBox(haze, 128, frame, box);
    const opacity = (local: Vec3): number | undefined => {
      const [u, v] = uvdFromLocal(frame.axes, local);
      return haze[Math.floor((frame.v0 - v) / 8) * 128 + Math.floor((u - frame.u0) / 8)];
    };
    for (const x of [100, 200, 300]) for (const y of [100, 150, 200]) for (const z of [0, 40]) expect(opacity([x, y, z])).toBe(0);
    expect(opacity([-60, 150, 0])).toBe(255);
    expect(opacity([460, 150, 0])).toBe(255);
    expect(haze.filter((alpha) => alpha === 0).length).toBeLessThan(700);
  }
});

import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Measure from "../../src/measure";
import type { Vec3 } from "../../src/map3d";
import { renderTown } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import type { Global } from "./page";
import { drawn, tapApart } from "./page";

const bed = new TestBed({ town: renderTown() }, { draws: false });

type Measuring = Global & { map3d: typeof Measure; tool: Measure.measure };
const PIXEL_M = 0.38;

async function measuring(kind: "line" | "height" | "area" | "profile"): Promise<{ page: Page; problems: string[] }> {
  const opened = await bed.start("town");
  await opened.page.addScriptTag({ url: "/map3d-measure.js" });
  await opened.page.evaluate((chosen) => {
    const g = globalThis as unknown as Measuring;
    g.tool = new g.map3d.measure({ kind: chosen, language: "en" }).addTo(g.map);
  }, kind);
  return opened;
}

/** Clicks where local positions on the surface are visible. */
async function clickAll(page: Page, places: readonly Vec3[], before = 0): Promise<void> {
  for (const [k, [x, y, z]] of places.entries()) {
    const at = await page.evaluate((world) => (globalThis as Global).map.project(world) as [number, number], [
      ORIGIN[0] + x,
      ORIGIN[1] + y,
      ORIGIN[2] + z,
    ] as const);
    await tapApart(page, at);
    await page.mouse.click(at[0], at[1]);
    await page.waitForFunction((count) => (globalThis as unknown as Measuring).tool.corners.length === count, before + k + 1);
  }
}

const labels = (page: Page): Promise<string[]> => page.locator(".map3d-measure span").allTextContents();

test("a line from roof to roof has the length of the model, exact at every zoom, and follows the map", async () => {
  const { page, problems } = await measuring("line");
  await clickAll(page, [
    [-45, -4, 34],
    [32, 26, 62],
    [32, -32, 16],
  ]);
  const line = await page.evaluate(() => (globalThis as unknown as Measuring).tool.line);
  const expected = [Math.hypot(77, 30, 28), Math.hypot(58, 46)];
  line.steps_m.forEach((step, k) => {
    expect(Math.abs(step - (expected[k] ?? 0))).toBeLessThan(2 * PIXEL_M);
  });
  expect(line.rise_m).toBeCloseTo(16 - 34, 1);
  expect(await page.evaluate(() => (globalThis as unknown as Measuring).tool.corners.some(({ approximate }) => approximate))).toBe(false);
  await page.screenshot({ path: `${OUT}/measure-line.png` });
  const texts = await labels(page);
  expect(texts.length).toBe(3);
  expect(texts[2]).toMatch(/^1\d\d\.\d m {2}↓ 1[78]\.\d\d m$/);
  const dot = (): Promise<number> => page.evaluate(() => Number(document.querySelector(".map3d-measure circle")?.getAttribute("cx")));
  const before = await dot();
  await page.evaluate(() => {
    (globalThis as Global).map.panBy(50, 0);
  });
  await drawn(page);
  expect((await dot()) - before).toBeCloseTo(50, 0);
  expect(problems).toEqual([]);
});

test("a height is the difference of two points; a third click starts again", async () => {
  const { page, problems } = await measuring("height");
  await clickAll(page, [
    [-45, -30, 0],
    [-45, -4, 34],
  ]);
  expect(await labels(page)).toEqual([expect.stringMatching(/^↑ 3[34]\.\d\d m$/)]);
  const results = (): Promise<(readonly [string, string])[]> => page.evaluate(() => [...(globalThis as unknown as Measuring).tool.results]);
  expect((await results()).map(([label]) => label)).toEqual(["Height difference", "Horizontal"]);
  expect(Math.abs(parseFloat((await results())[0]?.[1].slice(2) ?? "") - 34)).toBeLessThan(PIXEL_M);
  await clickAll(page, [[32, -32, 16]]);
  expect(await results()).toEqual([]);
  expect(problems).toEqual([]);
});

test("areas of a roof and a facade agree with the model", async () => {
  const { page } = await measuring("area");
  await clickAll(page, [
    [-61, -21, 34],
    [-29, -21, 34],
    [-29, 13, 34],
    [-61, 13, 34],
  ]);
  const roof = await page.evaluate(() => (globalThis as unknown as Measuring).tool.area);
  expect(Math.abs(roof.area_m2 - 32 * 34)).toBeLessThan(32 * 34 * 0.02);
  expect(roof.slope_deg).toBeLessThan(0.5);
  await page.screenshot({ path: `${OUT}/measure-roof.png` });
  await page.evaluate(() => (globalThis as unknown as Measuring).tool.clear());
  expect(await labels(page)).toEqual([]);
  await clickAll(page, [
    [-61, -22, 2],
    [-29, -22, 2],
    [-29, -22, 32],
    [-61, -22, 32],
  ]);
  const wall = await page.evaluate(() => (globalThis as unknown as Measuring).tool.area);
  expect(Math.abs(wall.area_m2 - 32 * 30)).toBeLessThan(32 * 30 * 0.03);
  expect(wall.slope_deg).toBeGreaterThan(88);
  expect((await labels(page))[0]).toMatch(/m² {2}∠ (89|90)°$/);
  await page.screenshot({ path: `${OUT}/measure-wall.png` });
});

test("one click on a wall or a roof measures and outlines the face, and marks a hidden part; a second corner starts a polygon", async () => {
  const { page, problems } = await measuring("area");
  const known = async (): Promise<Measure.Face> => {
    await page.waitForFunction(() => (globalThis as unknown as Measuring).tool.face !== null);
    return page.evaluate(() => (globalThis as unknown as Measuring).tool.face as Measure.Face);
  };
  await clickAll(page, [[-45, -22, 15]]);
  const wall = await known();
  expect(Math.abs(wall.area_m2 / (34 * 34) - 1)).toBeLessThan(0.02);
  expect([wall.hidden, wall.approximate]).toEqual([false, false]);
  expect(await labels(page)).toEqual([expect.stringMatching(/^1,1[5-7]\d m² {2}∠ 90°$/)]);
  // The outline's box is that of the wall in the picture.
  const place = ([x, y, z]: Vec3): Promise<[number, number]> =>
    page.evaluate((world) => (globalThis as Global).map.project(world) as [number, number], [
      ORIGIN[0] + x,
      ORIGIN[1] + y,
      ORIGIN[2] + z,
    ] as const);
  const outline = (): Promise<number[]> =>
    page.evaluate(() => {
      const { x, y, width, height } = (document.querySelector(".map3d-measure-filled") as SVGPathElement).getBBox();
      return [x, y, x + width, y + height];
    });
  const expected = async (): Promise<number[]> => [...(await place([-62, -22, 34])), ...(await place([-28, -22, 0]))];
  const off = async (): Promise<number> => {
    const [is, should] = [await outline(), await expected()];
    return Math.max(...is.map((value, k) => Math.abs(value - (should[k] ?? NaN))));
  };
  expect(await off()).toBeLessThan(2.5);
  await page.screenshot({ path: `${OUT}/measure-face.png` });
  await page.evaluate(() => {
    (globalThis as Global).map.panBy(60, 20).zoomBy(0.5, [400, 300]);
  });
  await drawn(page);
  expect(await off()).toBeLessThan(3.5);
  await clickAll(page, [[-30, -22, 30]], 1);
  expect(await labels(page)).toEqual([]);
  expect(await page.evaluate(() => (globalThis as unknown as Measuring).tool.face)).toBeNull();
  await page.evaluate(() => {
    (globalThis as unknown as Measuring).tool.clear();
  });
  // The chapel's wall is hidden by the town hall below.
  await clickAll(page, [[-28, 34, 18]]);
  const hidden = await known();
  expect(hidden.hidden).toBe(true);
  expect(hidden.area_m2).toBeLessThan(24 * 20);
  expect((await labels(page))[0]).toMatch(/^≥ \d{2,3}\.\d m² {2}∠ 90°$/);
  await page.screenshot({ path: `${OUT}/measure-face-hidden.png` });
  expect(problems).toEqual([]);
});

test("Backspace removes the last corner, Escape all; removing the tool leaves nothing behind", async () => {
  const { page } = await measuring("line");
  await clickAll(page, [
    [-45, -4, 34],
    [32, 26, 62],
  ]);
  await page.locator(".map3d").focus();
  await page.keyboard.press("Backspace");
  expect(await page.evaluate(() => (globalThis as unknown as Measuring).tool.corners.length)).toBe(1);
  await page.keyboard.press("Escape");
  expect(await page.evaluate(() => (globalThis as unknown as Measuring).tool.corners.length)).toBe(0);
  await page.mouse.click(5, 5);
  await page.waitForFunction(() => (globalThis as Global).clicks.length === 3);
  expect(await page.evaluate(() => (globalThis as unknown as Measuring).tool.corners.length), "nothing is there").toBe(0);
  await page.evaluate(() => {
    (globalThis as unknown as Measuring).tool.remove();
  });
  expect(await page.locator(".map3d-measure").count()).toBe(0);
});

test("a profile has the heights of the model and gaps where it is hidden; pointer and keys move its cursor", async () => {
  const { page, problems } = await measuring("profile");
  // Over the town hall (34 m) from the left, on its roof and down its far side.
  await clickAll(page, [
    [-80, -10, 0],
    [-45, -10, 34],
    [0, -10, 0],
  ]);
  await page.waitForFunction(() => (globalThis as unknown as Measuring).tool.profile !== null);
  const profile = await page.evaluate(() => {
    const { distances_m, heights_m, approximate } = (globalThis as unknown as Measuring).tool.profile as Measure.Profile;
    return { distances: [...distances_m], heights: [...heights_m], approximate };
  });
  expect(profile.approximate).toBe(false);
  const inside = profile.distances
    .map((distance, k) => ({ x: -80 + distance, height: (profile.heights[k] ?? NaN) - ORIGIN[2] }))
    .filter(({ x }) => Math.abs(x + 62) > 1.5 && Math.abs(x + 28) > 1.5);
  for (const { x, height } of inside) expect(Math.abs(height - (x > -62 && x < -28 ? 34 : 0))).toBeLessThan(2 * PIXEL_M);
  expect(inside.length).toBeGreaterThan(300);
  await page.screenshot({ path: `${OUT}/measure-profile.png` });
  const chart = page.locator(".map3d-profile");
  expect(await chart.getAttribute("aria-valuetext")).toMatch(/^80\.\d\d m {2}\d{3}\.\d\d – 5\d\d\.\d\d m/);
  await chart.focus();
  await page.keyboard.press("End");
  expect(await chart.getAttribute("aria-valuetext")).toMatch(/^(79|80)\.\d\d m {2}↕ \d{3}\.\d\d m$/);
  const marked = (): Promise<number | null> =>
    page.evaluate(() => {
      const mark = document.querySelector(".map3d-measure-mark");
      return mark && Number(mark.getAttribute("cx"));
    });
  const end = (await page.evaluate((world) => (globalThis as Global).map.project(world), [
    ORIGIN[0],
    ORIGIN[1] - 10,
    ORIGIN[2],
  ] as const)) as [number, number];
  expect(Math.abs(((await marked()) ?? 0) - end[0])).toBeLessThan(2);
  const box = (await chart.boundingBox()) as { x: number; y: number; width: number; height: number };
  await page.mouse.move(box.x + box.width / 2, box.y + 40);
  expect(await chart.getAttribute("aria-valuetext")).toMatch(/↕ 53[34]\.\d\d m$/);
  await page.screenshot({ path: `${OUT}/measure-profile-at.png` });
  await page.keyboard.press("Escape");
  await page
    .locator(".map3d-container, #mapcanvas")
    .first()
    .focus()
    .catch(() => undefined);
  await page.evaluate(() => (globalThis as unknown as Measuring).tool.clear());
  expect(await page.locator(".map3d-profile, .map3d-measure-mark").count()).toBe(0);
  // Behind the town hall, as seen from the south.
  await page.evaluate(
    (corners) => (globalThis as unknown as Measuring).tool.setCorners(corners.map((position) => ({ position, approximate: false }))),
    [
      [-45, 16, 0],
      [-45, 60, 0],
    ].map(([x = 0, y = 0, z = 0]) => [ORIGIN[0] + x, ORIGIN[1] + y, ORIGIN[2] + z] as Vec3),
  );
  await page.waitForFunction(() => (globalThis as unknown as Measuring).tool.profile !== null);
  const hidden = await page.evaluate(() =>
    [...((globalThis as unknown as Measuring).tool.profile as Measure.Profile).heights_m].map((height) => Number.isNaN(height)),
  );
  expect(hidden.slice(0, 200).every(Boolean)).toBe(true);
  expect(hidden.slice(-40).some(Boolean)).toBe(false);
  await page.screenshot({ path: `${OUT}/measure-profile-hidden.png` });
  expect(problems).toEqual([]);
});

test("a height between points that are not one above the other is doubtful, and so is a point that fell past an edge", async () => {
  const { page, problems } = await measuring("height");
  const warnings = (): Promise<string[]> => page.evaluate(() => [...(globalThis as unknown as Measuring).tool.warnings]);
  await clickAll(page, [
    [-45, -22, 2],
    [-45, -22, 30],
  ]);
  expect(await warnings()).toEqual([]);
  await clickAll(page, [
    [-45, -30, 0],
    [-45, -4, 34],
  ]);
  expect(await warnings()).toEqual(["The points are not one above the other."]);
  // A few pixels above the far edge of the roof, on the ground behind it.
  const at = await page.evaluate((world) => (globalThis as Global).map.project(world) as [number, number], [
    ORIGIN[0] - 45,
    ORIGIN[1] + 14,
    ORIGIN[2] + 34,
  ] as const);
  await page.evaluate(() => (globalThis as unknown as Measuring).tool.clear());
  await page.mouse.click(at[0], at[1] - 4);
  await page.waitForFunction(() => (globalThis as unknown as Measuring).tool.corners[0]?.pastEdge);
  expect(await warnings()).toEqual(["A point fell past an edge, onto the surface behind it."]);
  expect(problems).toEqual([]);
});

import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Measure from "../../src/measure";
import type { Vec3 } from "../../src/map3d";
import { renderTown } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./bed";
import { OUT } from "./browser";
import type { Global } from "./page";


const bed = new TestBed({ town: renderTown() });

type Measuring = Global & { map3d: typeof Measure; tool: Measure.measure };
/** Longer than a double tap. */
const APART_MS = 600;
const PIXEL_M = 0.38;

async function measuring(kind: "line" | "area"): Promise<{ page: Page; problems: string[] }> {
  const opened = await bed.start("town");
  await opened.page.addScriptTag({ url: "/map3d-measure.js" });
  await opened.page.evaluate((chosen) => {
    const g = globalThis as unknown as Measuring;
    g.tool = new g.map3d.measure({ kind: chosen, language: "en" }).addTo(g.map);
  }, kind);
  return opened;
}

/** Clicks where local places of the surface are seen. */
async function clickAll(page: Page, places: readonly Vec3[]): Promise<void> {
  for (const [k, [x, y, z]] of places.entries()) {
    const at = await page.evaluate((world) => (globalThis as Global).map.project(world) as [number, number], [ORIGIN[0] + x, ORIGIN[1] + y, ORIGIN[2] + z] as const);
    await page.mouse.click(at[0], at[1]);
    await page.waitForFunction((count) => (globalThis as unknown as Measuring).tool.corners.length === count, k + 1);
    await page.waitForTimeout(APART_MS);
  }
}

const labels = (page: Page): Promise<string[]> => page.locator(".map3d-measure span").allTextContents();

test("a line from roof to roof is as long as in the model, exact at every zoom, and goes with the picture", async () => {
  const { page, problems } = await measuring("line");
  await clickAll(page, [[-45, -4, 34], [32, 26, 62], [32, -32, 16]]);
  const line = await page.evaluate(() => (globalThis as unknown as Measuring).tool.line);
  const expected = [Math.hypot(77, 30, 28), Math.hypot(58, 46)];
  line.steps_m.forEach((step, k) => { expect(Math.abs(step - (expected[k] ?? 0))).toBeLessThan(2 * PIXEL_M); });
  expect(line.rise_m).toBeCloseTo(16 - 34, 1);
  expect(await page.evaluate(() => (globalThis as unknown as Measuring).tool.corners.some(({ approximate }) => approximate))).toBe(false);
  await page.screenshot({ path: `${OUT}/measure-line.png` });
  const texts = await labels(page);
  expect(texts.length).toBe(3);
  expect(texts[2]).toMatch(/^1\d\d\.\d m {2}↓ 1[78]\.\d\d m$/);
  const dot = (): Promise<number> => page.evaluate(() => Number(document.querySelector(".map3d-measure circle")?.getAttribute("cx")));
  const before = await dot();
  await page.evaluate(() => { (globalThis as Global).map.panBy(50, 0); });
  await page.waitForTimeout(300);
  expect(await dot() - before).toBeCloseTo(50, 0);
  expect(problems).toEqual([]);
  await page.context().close();
});

test("areas of a roof and of a facade are those of the model", async () => {
  const { page } = await measuring("area");
  await clickAll(page, [[-61, -21, 34], [-29, -21, 34], [-29, 13, 34], [-61, 13, 34]]);
  const roof = await page.evaluate(() => (globalThis as unknown as Measuring).tool.area);
  expect(Math.abs(roof.area_m2 - 32 * 34)).toBeLessThan(32 * 34 * 0.02);
  expect(roof.slope_deg).toBeLessThan(0.5);
  await page.screenshot({ path: `${OUT}/measure-roof.png` });
  await page.evaluate(() => (globalThis as unknown as Measuring).tool.clear());
  expect(await labels(page)).toEqual([]);
  await clickAll(page, [[-61, -22, 2], [-29, -22, 2], [-29, -22, 32], [-61, -22, 32]]);
  const wall = await page.evaluate(() => (globalThis as unknown as Measuring).tool.area);
  expect(Math.abs(wall.area_m2 - 32 * 30)).toBeLessThan(32 * 30 * 0.03);
  expect(wall.slope_deg).toBeGreaterThan(88);
  expect((await labels(page))[0]).toMatch(/m² {2}∠ (89|90)°$/);
  await page.screenshot({ path: `${OUT}/measure-wall.png` });
  await page.context().close();
});

test("corners are taken back by Backspace, all by Escape; taken off, the tool leaves nothing", async () => {
  const { page } = await measuring("line");
  await clickAll(page, [[-45, -4, 34], [32, 26, 62]]);
  await page.locator(".map3d").focus();
  await page.keyboard.press("Backspace");
  expect(await page.evaluate(() => (globalThis as unknown as Measuring).tool.corners.length)).toBe(1);
  await page.keyboard.press("Escape");
  expect(await page.evaluate(() => (globalThis as unknown as Measuring).tool.corners.length)).toBe(0);
  await page.mouse.click(5, 5);
  await page.waitForTimeout(APART_MS);
  expect(await page.evaluate(() => (globalThis as unknown as Measuring).tool.corners.length), "nothing is there").toBe(0);
  await page.evaluate(() => { (globalThis as unknown as Measuring).tool.remove(); });
  expect(await page.locator(".map3d-measure").count()).toBe(0);
  await page.context().close();
});

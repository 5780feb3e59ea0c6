import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Compare from "../../src/compare";
import { renderLater } from "../fixture/secondEpoch";
import { renderTown } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { picture, settled, type Global } from "./page";

const bed = new TestBed({ town: renderTown(), later: renderLater() });
const VIEWPORT = { viewport: { width: 500, height: 420 } };
type Comparing = Global & { map3d: typeof Compare; later: Global["layer"]; swipe: Compare.swipe; epochs: Compare.epochs };

const WIDE = 500;
/** Counts the pixels of the columns [from, to) that differ between two pictures. */
function differences(a: Buffer, b: Buffer, from: number, to: number): number {
  let count = 0;
  for (let y = 0; y < 420; y++)
    for (let x = from; x < to; x++) if (a.readUInt32LE(4 * (WIDE * y + x)) !== b.readUInt32LE(4 * (WIDE * y + x))) count++;
  return count;
}

/** Takes a picture of each rendering alone. */
async function alone(rendering: string, drawer: string): Promise<Buffer> {
  const { page } = await bed.start(rendering, { drawer, zoom: 3, center: ORIGIN }, {}, VIEWPORT);
  const shot = await picture(page);
  await page.context().close();
  return shot;
}

const rests = (page: Page): Promise<void> => settled(page, () => (globalThis as Global).map.setLight({}), null);

test.each(["webgl", "canvas"])(
  "%s: a swipe shows one layer on each side, moves by pointer and keys, and loads no depth",
  async (drawer) => {
    const [before, after] = [await alone("town", drawer), await alone("later", drawer)];
    const { page, problems } = await bed.start("town", { drawer, zoom: 3, center: ORIGIN }, {}, VIEWPORT);
    await page.addScriptTag({ url: "/map3d-compare.js" });
    bed.server.requests.length = 0;
    await page.evaluate((url) => {
      const g = globalThis as Comparing;
      g.later = new g.map3d.imageLayer(url).addTo(g.map);
      g.swipe = new g.map3d.swipe(g.layer, g.later, { at: 0.5, names: ["2014", "2024"] }).addTo(g.map);
    }, bed.url("later"));
    await page.waitForFunction(() => (globalThis as Comparing).later.rendering);
    await rests(page);
    await page.screenshot({ path: `${OUT}/swipe-${drawer}.png` });
    const half = await picture(page);
    expect([differences(half, before, 0, 250), differences(half, after, 250, WIDE)]).toEqual([0, 0]);
    expect(differences(half, before, 250, WIDE)).toBeGreaterThan(1000);
    expect(bed.server.requests.filter((path) => path.includes("/depth/"))).toEqual([]);

    const border = page.getByRole("slider", { name: "Drag to compare" });
    const { x, y, width, height } = (await border.boundingBox()) as { x: number; y: number; width: number; height: number };
    expect(width).toBeGreaterThanOrEqual(44);
    await page.mouse.move(x + width / 2, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + width / 2 - 100, y + height / 2, { steps: 3 });
    await page.mouse.up();
    expect(await page.evaluate(() => (globalThis as Comparing).swipe.at)).toBeCloseTo(0.3, 6);
    await page.keyboard.press("ArrowRight");
    expect(await border.getAttribute("aria-valuenow")).toBe("32");
    await page.keyboard.press("End");
    await rests(page);
    expect(differences(await picture(page), before, 0, WIDE)).toBe(0);
    await page.evaluate(() => {
      (globalThis as Comparing).swipe.remove();
    });
    expect(await border.count()).toBe(0);
    expect(await page.evaluate(() => [(globalThis as Comparing).layer.clip, (globalThis as Comparing).later.clip])).toEqual([null, null]);
    expect(problems).toEqual([]);
  },
);

test("epochs show one layer at a time, and the slider shows its label", async () => {
  const [before, after] = [await alone("town", "webgl"), await alone("later", "webgl")];
  const { page, problems } = await bed.start("town", { zoom: 3, center: ORIGIN }, {}, VIEWPORT);
  await page.addScriptTag({ url: "/map3d-compare.js" });
  await page.evaluate((url) => {
    const g = globalThis as Comparing;
    g.later = new g.map3d.imageLayer(url);
    g.epochs = new g.map3d.epochs(
      [
        { layer: g.layer, label: "2014" },
        { layer: g.later, label: "2024" },
      ],
      { shown: 0 },
    ).addTo(g.map);
  }, bed.url("later"));
  const slider = page.getByRole("slider", { name: "Time" });
  expect(await slider.getAttribute("aria-valuetext")).toBe("2014");
  const opacities = (): Promise<number[]> =>
    page.evaluate(() => [(globalThis as Comparing).layer.opacity, (globalThis as Comparing).later.opacity]);
  expect(await opacities()).toEqual([1, 0]);
  await slider.press("ArrowRight");
  await page.waitForFunction(() => (globalThis as Comparing).layer.opacity === 0);
  await rests(page);
  await page.screenshot({ path: `${OUT}/epochs.png` });
  expect(await slider.getAttribute("aria-valuetext")).toBe("2024");
  expect(differences(await picture(page), after, 0, WIDE)).toBe(0);
  await slider.press("Home");
  await page.waitForFunction(() => (globalThis as Comparing).later.opacity === 0);
  await rests(page);
  expect(differences(await picture(page), before, 0, WIDE)).toBe(0);
  expect(problems).toEqual([]);
});

import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Labelled from "../../src/labels";
import { lonLatFromLocal } from "../../src/geo/geographic";
import { renderTown } from "../fixture/rendering";
import { PLACE } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { animationsEnd, drawn, settled, type Global } from "./page";

const bed = new TestBed({ town: renderTown() }, { draws: false });
type G = Global & { map3d: typeof Labelled; names: Labelled.labels; streets: Labelled.labels };
const line = (...points: [number, number][]): object => ({
  type: "LineString",
  coordinates: points.map((point) => lonLatFromLocal(PLACE, point)),
});
const STREETS = {
  type: "FeatureCollection",
  features: [
    { type: "Feature", properties: { name: "Long Street" }, geometry: line([-95, 26], [95, 26]) },
    { type: "Feature", properties: { name: "Cross Street" }, geometry: line([-8, -75], [-8, -40]) },
    { type: "Feature", properties: { name: "Back Yard" }, geometry: { type: "Point", coordinates: lonLatFromLocal(PLACE, [32, 40]) } },
  ],
};

async function start(drawer: string, options: object = {}, context: object = {}): Promise<{ page: Page; problems: string[] }> {
  const opened = await bed.start("town", { drawer, zoom: 3, ...options }, {}, context);
  await opened.page.addScriptTag({ url: `${bed.server.origin}/map3d-labels.js` });
  await opened.page.evaluate((streets) => {
    const g = globalThis as G;
    g.names = new g.map3d.Labels(g.layer).addTo(g.map);
    g.streets = new g.map3d.Labels(streets, { button: false }).addTo(g.map);
  }, STREETS);
  await opened.page.waitForFunction(() => [...(globalThis as G).names.visible, ...(globalThis as G).streets.visible].length >= 5);
  await animationsEnd(opened.page); // fades in
  return opened;
}

const visible = (page: Page): Promise<string[]> =>
  page.evaluate(() => [...(globalThis as G).names.visible, ...(globalThis as G).streets.visible].sort());
const boxes = (page: Page): Promise<{ text: string; x: number; y: number; width: number; height: number }[]> =>
  page.locator(".map3d-label-shown").evaluateAll((all) =>
    all.map((each) => {
      const { x, y, width, height } = each.getBoundingClientRect();
      return { text: each.textContent, x, y, width, height };
    }),
  );

test.each(["webgl", "canvas"])(
  "%s: names of buildings and streets stand at their places, none hidden by a building and none overlapping",
  async (drawer) => {
    const { page, problems } = await start(drawer);
    await page.screenshot({ path: `${OUT}/labels-${drawer}.png` });
    expect(await visible(page)).toEqual(["Chapel", "Cross Street", "Long Street", "School <b>old</b>", "Tower", "Town hall"]); // the yard is behind the tower, the ground has no label
    const shown = await boxes(page);
    const tower = await page.evaluate(() => (globalThis as Global).map.project([691032, 5336026, 562]) as [number, number]);
    const label = shown.find(({ text }) => text === "Tower");
    expect(Math.abs((label?.x ?? 0) + (label?.width ?? 0) / 2 - tower[0])).toBeLessThan(1.5);
    expect(tower[1] - (label?.y ?? 0) - (label?.height ?? 0)).toBeCloseTo(4, 0);
    expect(await page.locator(".map3d-label b").count()).toBe(0);
    for (const [k, a] of shown.entries())
      for (const b of shown.slice(k + 1))
        expect(a.x + a.width < b.x || b.x + b.width < a.x || a.y + a.height < b.y || b.y + b.height < a.y).toBe(true);
    expect(problems).toEqual([]);
  },
);

test("labels that a building hides in one direction are visible in another", async () => {
  const { page } = await start("webgl");
  await settled(page, () => (globalThis as Global).map.rotate(1).rotate(1), null);
  await expect.poll(() => visible(page)).toContain("Back Yard");
  await page.screenshot({ path: `${OUT}/labels-south.png` });
});

test("while the map is dragged no label appears or vanishes, and all move with the picture", async () => {
  const { page } = await start("webgl");
  const before = await boxes(page);
  const changes = await page.evaluate(() => {
    const told: string[] = [];
    new MutationObserver((list) => {
      for (const { target } of list) told.push(`${(target as Element).textContent} ${(target as Element).className}`);
    }).observe(document.querySelector(".map3d-labels")?.parentElement as Element, {
      attributes: true,
      attributeFilter: ["class"],
      subtree: true,
    });
    Object.assign(globalThis, { told });
    return told.length;
  });
  expect(changes).toBe(0);
  await page.mouse.move(400, 300);
  await page.mouse.down();
  await page.mouse.move(440, 320, { steps: 12 });
  await page.waitForTimeout(150);
  const moved = await boxes(page);
  await page.mouse.up();
  await drawn(page);
  await animationsEnd(page);
  for (const { text, x, y } of before) {
    const after = moved.find((each) => each.text === text);
    expect(Math.hypot((after?.x ?? NaN) - x - 40, (after?.y ?? NaN) - y - 20)).toBeLessThan(1.5);
  }
  expect(
    await page.evaluate(() => (globalThis as unknown as { told: string[] }).told.filter((each) => !each.includes("map3d-dragging"))),
  ).toEqual([]);
});

test("where there is no room, the larger object has its name; a switch hides all names", async () => {
  const { page, problems } = await start("webgl", {}, { viewport: { width: 390, height: 844 } });
  await settled(page, () => (globalThis as Global).map.setZoom(0.6), null);
  await animationsEnd(page);
  await page.screenshot({ path: `${OUT}/labels-phone.png` });
  const shown = await boxes(page);
  expect(shown.length).toBeGreaterThan(0);
  expect(shown.length).toBeLessThan(6);
  for (const [k, a] of shown.entries())
    for (const b of shown.slice(k + 1))
      expect(a.x + a.width < b.x || b.x + b.width < a.x || a.y + a.height < b.y || b.y + b.height < a.y).toBe(true);
  const button = page.getByRole("button", { name: "Names on the map" });
  expect(await button.getAttribute("aria-pressed")).toBe("true");
  await button.click();
  expect([await button.getAttribute("aria-pressed"), await page.evaluate(() => (globalThis as G).names.visible)]).toEqual(["false", []]);
  await page.evaluate(() => {
    (globalThis as G).names.remove();
    (globalThis as G).streets.remove();
  });
  expect(await page.locator(".map3d-labels, .map3d-label").count()).toBe(0);
  expect(problems).toEqual([]);
});

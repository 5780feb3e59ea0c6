import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import { published } from "../fixture/folder";
import { renderTown, type Fixture } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { drawn as atRest, picture, steady, type Global } from "./page";
import { TestBed } from "./testBed";

const town = renderTown(64, 0.76);
/** The town, published again after a change: every archive has another name. */
const [first, second] = [1, 2].map((version): Fixture => {
  const { json, files, raw } = published(town);
  const renamed = (path: string): string => path.replace(".pmtiles", `-${String(version)}.pmtiles`);
  const views = json.views.map((view) => ({
    ...view,
    archives: Object.fromEntries(Object.entries(view.archives ?? {}).map(([name, path]) => [name, renamed(path)])),
  }));
  return {
    json: { ...json, content_version: version, views },
    files: new Map([...files].map(([path, bytes]) => [renamed(path), bytes])),
    raw,
  };
}) as [Fixture, Fixture];

const bed = new TestBed({ town, first, second }, { draws: false });
const drawing = new TestBed(bed.server);
const ROOF: [number, number, number] = [ORIGIN[0] - 45, ORIGIN[1] - 4, ORIGIN[2] + 34];

/** Returns where a point of the map is in the window, measured with an element at that point. */
const inWindow = (page: Page, [x, y]: readonly [number, number]): Promise<[number, number]> =>
  page.evaluate(
    ([left, top]) => {
      const mark = document.createElement("i");
      mark.style.cssText = `position:absolute;left:${String(left)}px;top:${String(top)}px;width:0;height:0`;
      (globalThis as Global).map.container.append(mark);
      const box = mark.getBoundingClientRect();
      mark.remove();
      return [box.left, box.top] as [number, number];
    },
    [x, y] as const,
  );

const project = (page: Page, world: readonly [number, number, number]): Promise<[number, number]> =>
  page.evaluate((at) => (globalThis as Global).map.project(at) as [number, number], world);

test.each([
  ["transform", "scale(0.5)"],
  ["transform", "translate(40px, 10px) scale(1.25, 1.1)"],
  ["transform", "rotate(12deg) scale(0.7)"],
  ["transform", "perspective(900px) rotateY(25deg) scale(0.7)"],
  ["zoom", "0.5"],
  ["zoom", "1.5"],
])("in a page with %s: %s, clicks pick what is under them and a drag follows the pointer", async (property, value) => {
  const { page } = await bed.start("town", { zoom: 3 });
  await page.evaluate(
    ([name, text]) => {
      document.body.style.setProperty("transform-origin", "0 0");
      document.body.style.setProperty(name, text);
    },
    [property, value] as const,
  );
  await atRest(page);
  const at = await project(page, ROOF);
  const to = [at[0] - 60, at[1] + 40] as const;
  await page.mouse.click(...(await inWindow(page, at)));
  await page.waitForFunction(() => (globalThis as Global).clicks.length > 0);
  const click = await page.evaluate(() => (globalThis as Global).clicks[0]);
  expect(click?.id).toBe(17);
  expect(Math.hypot((click?.point[0] ?? 0) - at[0], (click?.point[1] ?? 0) - at[1])).toBeLessThan(1);
  await page.mouse.move(...(await inWindow(page, at)));
  await page.mouse.down();
  await page.mouse.move(...(await inWindow(page, [at[0] - 20, at[1] + 10])));
  await page.mouse.move(...(await inWindow(page, to)));
  const moved = await project(page, ROOF);
  await page.mouse.up();
  expect(Math.hypot(moved[0] - to[0], moved[1] - to[1])).toBeLessThan(2);
});

test("maps give their WebGL contexts back at once: another one on the page lives; the next map on a canvas draws as the first", async () => {
  const { page } = await drawing.start("town", { drawer: "webgl", zoom: 3 });
  const before = await picture(page);
  const lost = await page.evaluate(async (url) => {
    const g = globalThis as Global;
    const other = document.createElement("canvas");
    document.body.append(other);
    const gl = other.getContext("webgl2");
    for (let count = 0; count < 24; count++) {
      const box = document.createElement("div");
      document.body.append(box);
      const map = new g.map3d.map(box, { drawer: "webgl" });
      new g.map3d.imageLayer(url).addTo(map);
      await new Promise(requestAnimationFrame);
      map.remove();
      box.remove();
    }
    other.remove();
    return gl?.isContextLost();
  }, bed.url("town"));
  expect(lost).toBe(false);
  expect(await page.evaluate(() => (globalThis as Global).map.canvas.getContext("webgl2")?.isContextLost())).toBe(false);
  const again = await page.evaluate(async (url) => {
    const g = globalThis as Global;
    const { canvas } = g.map;
    g.map.remove();
    g.map = new g.map3d.map(canvas, { drawer: "webgl", preserveDrawingBuffer: true, zoom: 3 });
    new g.map3d.imageLayer(url).addTo(g.map);
    await new Promise((done) => g.map.once("contextrestored", done));
    return [g.map.drawer, String(g.map.canvas === canvas)];
  }, bed.url("town"));
  expect(again).toEqual(["webgl", "true"]);
  await atRest(page);
  expect((await picture(page)).equals(before)).toBe(true);
});

test("cooperative: the wheel scrolls the page and zooms with Ctrl; one finger scrolls it, two move the map; each time a hint says so", async () => {
  const { page } = await bed.start("town", { zoom: 3, gestureHandling: "auto" });
  const zoom = (): Promise<number> => page.evaluate(() => (globalThis as Global).map.zoom);
  const scrolled = (): Promise<number> => page.evaluate(() => scrollY);
  await page.mouse.move(400, 300);
  await page.mouse.wheel(0, -260);
  await page.waitForFunction(() => (globalThis as Global).map.zoom > 3.9);
  await page.evaluate(() => (document.body.style.height = "300vh"));
  await atRest(page);
  const before = await zoom();
  await page.mouse.wheel(0, 120);
  await page.waitForFunction(() => scrollY > 50);
  expect(await zoom()).toBe(before);
  expect(await page.locator(".map3d-hint").textContent()).toBe("Use Ctrl + scroll to zoom the map");
  await page.keyboard.down("Control");
  await page.mouse.wheel(0, 80);
  await page.waitForFunction((then) => (globalThis as Global).map.zoom < then - 0.5, before);
  await page.keyboard.up("Control");
  await atRest(page);
  await page.evaluate(() => scrollTo(0, 100));

  const session = await page.context().newCDPSession(page);
  const touch = (type: "touchStart" | "touchMove" | "touchEnd", ...points: [number, number][]): Promise<unknown> =>
    session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  const start = await project(page, ROOF);
  await touch("touchStart", [400, 200]);
  for (let y = 205; y <= 260; y += 5) await touch("touchMove", [400, y]);
  await touch("touchEnd");
  await page.waitForFunction(() => scrollY < 80);
  expect(await project(page, ROOF)).toEqual(start);
  expect(await page.locator(".map3d-hint").textContent()).toBe("Use two fingers to move the map");
  const top = await steady(page, scrolled);
  await touch("touchStart", [350, 200], [450, 200]);
  for (let y = 205; y <= 260; y += 5) await touch("touchMove", [350, y], [450, y]);
  await touch("touchEnd");
  const moved = await project(page, ROOF);
  expect(moved[1] - start[1]).toBeGreaterThan(50);
  expect(await scrolled()).toBe(top);
  await page.locator(".map3d-hint").waitFor({ state: "detached" });
});

test("an open map shows the next publication when the archives of its own are gone, and reads the manifest once for it", async () => {
  bed.server.renderings.set("published", first);
  const { page, problems } = await bed.start("published", { zoom: 0 });
  bed.server.renderings.set("published", second);
  bed.server.requests.length = 0;
  await page.evaluate(() => (globalThis as Global).map.setZoom(4));
  await page.waitForFunction(() => (globalThis as Global).layer.rendering?.json.content_version === 2);
  await atRest(page);
  expect(bed.server.requests.filter((url) => url.endsWith("rendering.json"))).toHaveLength(1);
  expect(bed.server.requests.some((url) => url.endsWith("-2.pmtiles"))).toBe(true);
  expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([]);
  expect(problems.filter((text) => !text.includes("404"))).toEqual([]);
});

test("archives that are gone without another publication are an error, once", async () => {
  bed.server.renderings.set("published", first);
  const { page } = await bed.start("published", { zoom: 0 });
  bed.server.renderings.set("published", { ...first, files: new Map() });
  await page.evaluate(() => (globalThis as Global).map.setZoom(4));
  await page.waitForFunction(() => (globalThis as Global).errors.length > 0);
  await page.waitForTimeout(300);
  expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([expect.stringMatching(/pmtiles: HTTP 404/)]);
});

import { expect, test } from "vitest";
import { devices, type Page } from "playwright-core";
import { decodePng } from "../../src/core/png";
import { renderTown } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { OUT, resting } from "./browser";
import { animationsEnd, tapApart } from "./page";

// The page's tools, light and layout.
const drawn = new TestBed({ town: renderTown(256, 0.38) });
const bed = new TestBed(drawn.server, { draws: false });
const PHONE = {
  viewport: { width: 390, height: 844 },
  deviceScaleFactor: 2,
  isMobile: true,
  hasTouch: true,
  userAgent: devices["iPhone 14"].userAgent,
};
const DESK = { viewport: { width: 1280, height: 800 } };

/** The page with the town, at rest. */
const open = (options: object, query = bed.url("town"), from = bed): Promise<{ page: Page; problems: string[] }> =>
  from.openReadyMade(query, options);

test("the measuring tool takes the clicks: kinds, results with labels, undo, clear, and an end", async () => {
  const { page, problems } = await open(PHONE);
  const corners = (count: number): Promise<unknown> =>
    page.waitForFunction((wanted) => document.querySelectorAll(".map3d-measure circle").length === wanted, count);
  const tap = async (x: number, y: number, count: number): Promise<void> => {
    await tapApart(page, [x, y]);
    await page.touchscreen.tap(x, y);
    await corners(count);
  };
  const results = (): Promise<string[]> =>
    page
      .locator("#measured div")
      .evaluateAll((rows) => rows.map((row) => `${row.firstElementChild?.textContent ?? ""}: ${row.lastElementChild?.textContent ?? ""}`));
  await page.locator("#measure").tap();
  await page.waitForSelector(".map3d-measure", { state: "attached" });
  expect(await page.locator("#hint").textContent()).toBe("Tap points along the line.");
  expect(await page.locator("#measure-undo").isDisabled()).toBe(true);
  await tap(150, 420, 1);
  await tap(240, 450, 2);
  await page.screenshot({ path: `${OUT}/phone-measure.png` });
  expect(await page.locator(".map3d-measure-main").textContent()).toMatch(/^\d+\.\d+ m {2}[↑↓±] \d+\.\d\d m$/);
  expect((await results()).map((text) => text.replace(/[\d.]+/g, "N"))).toEqual([
    "Length: N m",
    "Horizontal: N m",
    expect.stringMatching(/^Height difference: [↑↓±] N m$/),
  ]);
  expect(await page.locator("#info").isHidden()).toBe(true);
  await page.locator("#measure-undo").tap();
  await corners(1);
  expect(await page.locator("#hint").isVisible()).toBe(true);
  // The cross in the middle of the map.
  await page.locator("#measure-add").tap();
  await corners(2);
  await page.locator("#measure-clear").tap();
  await corners(0);
  await page.locator("#measure-height").tap();
  await tap(150, 420, 1);
  await tap(240, 450, 2);
  expect((await results()).map((text) => text.split(":")[0])).toEqual(["Height difference", "Horizontal"]);
  await tap(150, 420, 1);
  await page.locator("#measure-profile").tap();
  expect(await page.locator("#hint").textContent()).toBe("Tap the start and the end of the line.");
  await tap(130, 380, 1);
  await page.touchscreen.tap(300, 440);
  await page.waitForSelector(".map3d-profile");
  await page.waitForSelector("#measured div");
  await page.screenshot({ path: `${OUT}/phone-profile.png` });
  await page.locator("#measure-finish").tap();
  expect(await page.locator(".map3d-measure, .map3d-profile").count()).toBe(0);
  await tapApart(page, [150, 420]);
  await page.touchscreen.tap(150, 420);
  await page.waitForSelector("#info:not([hidden])");
  expect(problems).toEqual([]);
});

test("the sun moves through the day from dawn to dusk; sunrise and sunset are marked, and nothing is black", async () => {
  const { page, problems } = await open(DESK, `${bed.url("town")}#0-45/691000.0/5336000.0/500.0/1.60/t=2026-06-21T08:00Z`, drawn);
  const clock = (): Promise<string | null> => page.locator("#clock").textContent();
  const before = await clock();
  for (const [id, title] of [
    ["#sunrise", /^Sunrise: \d+:\d\d$/],
    ["#sunset", /^Sunset: \d+:\d\d$/],
  ] as const)
    expect(await page.locator(id).getAttribute("title")).toMatch(title);
  await page.locator("#play").click();
  expect(await page.locator("#play").getAttribute("aria-label")).toBe("Pause");
  await expect.poll(clock, { timeout: 20_000 }).not.toBe(before);
  await page.locator("#play").click();
  expect(await page.locator("#play").getAttribute("aria-label")).toBe("Play through the day");
  const stopped = await clock();
  await page.waitForTimeout(500);
  expect(await clock()).toBe(stopped);
  // At the end of the slider, it starts again at dawn.
  await page.locator("#time").focus();
  await page.keyboard.press("End");
  const dusk = await page.locator("#mapcanvas").screenshot({ path: `${OUT}/page-dusk.png` });
  const { width, height, channels, data } = await decodePng(Uint8Array.from(dusk));
  const middle = [...data.subarray(channels * (width * Math.floor(height / 2) + 450), channels * (width * Math.floor(height / 2) + 750))];
  expect(middle.reduce((sum, value) => sum + value, 0) / middle.length).toBeGreaterThan(30);
  await page.locator("#play").click();
  await expect.poll(async () => Number(await page.locator("#time").inputValue()), { timeout: 20_000 }).toBeLessThan(12);
  expect(problems).toEqual([]);
});

test("a link's time at night is shown as it is, until the slider moves, and is not black", async () => {
  const { page, problems } = await open(
    { ...DESK, timezoneId: "Europe/Berlin" },
    `${bed.url("town")}#0-45/691000.0/5336000.0/500.0/1.60/t=2026-06-21T22:47Z`,
    drawn,
  );
  const clock = (): Promise<string | null> => page.locator("#clock").textContent();
  expect(await clock()).toBe("0:47");
  expect(await page.locator("#time").getAttribute("aria-valuetext")).toBe("0:47");
  const { width, height, channels, data } = await decodePng(
    Uint8Array.from(await page.locator("#mapcanvas").screenshot({ path: `${OUT}/page-night.png` })),
  );
  const middle = [...data.subarray(channels * (width * Math.floor(height / 2) + 450), channels * (width * Math.floor(height / 2) + 750))];
  expect(middle.reduce((sum, value) => sum + value, 0) / middle.length).toBeGreaterThan(30);
  await page.locator("#time").focus();
  await page.keyboard.press("ArrowRight");
  expect(Number((await clock())?.split(":")[0])).toBeGreaterThan(3);
  expect(problems).toEqual([]);
});

for (const drawer of ["webgl", "canvas"]) {
  test(`${drawer}: the content fades into the background, which takes the light of the sky`, async () => {
    const { page, problems } = await drawn.openPage(DESK, { maps: true });
    if (drawer === "canvas")
      await page.addInitScript(() => {
        Object.defineProperty(globalThis, "WebGL2RenderingContext", { value: undefined });
      });
    await page.goto(`${bed.server.origin}/?rendering=${bed.url("town")}#0-45/691000.0/5336000.0/500.0/1.00/t=2026-06-21T12:00Z`);
    await page.waitForSelector(".haze.shown");
    await resting(page);
    await animationsEnd(page);
    const look = async (path: string): Promise<number[][]> => {
      const { width, channels, data } = await decodePng(Uint8Array.from(await page.screenshot({ path: `${OUT}/${path}.png` })));
      return [
        [900, 60],
        [640, 400],
      ].map(([x = 0, y = 0]) => [...data.subarray(channels * (y * width + x), channels * (y * width + x) + 3)]);
    };
    const [noonSky] = await look(`haze-${drawer}`);
    expect(noonSky).toEqual([242, 240, 235]);
    // A row of pixels across the edge has no step.
    const { width, channels, data } = await decodePng(Uint8Array.from(await page.screenshot()));
    const row = Array.from({ length: 500 }, (_, k) => data[channels * (400 * width + 380 + k - 200)] ?? 0);
    const steps = row.slice(1).map((value, k) => Math.abs(value - (row[k] ?? 0)));
    const first = steps.findIndex((step) => step > 0);
    expect(first).toBeGreaterThan(0);
    expect(Math.max(...steps.slice(first, first + 4))).toBeLessThan(40);
    await page.locator("#time").focus();
    await page.keyboard.press("End");
    await resting(page);
    await animationsEnd(page);
    const [[red = 0, , blue = 0] = []] = await look(`haze-dusk-${drawer}`);
    expect(red).toBeLessThan(120);
    expect(blue).toBeGreaterThan(red);
    expect(problems).toEqual([]);
  });
}

test("with a mouse, hints say click, and Escape leaves the measuring tool", async () => {
  const { page, problems } = await open(DESK);
  await page.locator("#measure").click();
  await page.waitForSelector(".map3d-measure", { state: "attached" });
  expect(await page.locator("#hint").textContent()).toBe("Click points along the line.");
  expect(await page.locator("#mapcanvas").evaluate((canvas) => getComputedStyle(canvas).cursor)).toBe("crosshair");
  expect(await page.locator("#measure-add").isVisible()).toBe(false);
  await page.mouse.click(500, 420);
  await page.waitForFunction(() => document.querySelectorAll(".map3d-measure circle").length === 1);
  await page.keyboard.press("Escape");
  expect(await page.locator(".map3d-measure").count()).toBe(0);
  expect(await page.locator("#measuring").isVisible()).toBe(false);
  expect(await page.evaluate(() => document.activeElement?.id)).toBe("measure");
  expect(problems).toEqual([]);
});

test("on a phone, the selection moves clear of its card; a spot on the ground is marked and located", async () => {
  const { page, problems } = await open(PHONE, `${bed.url("town")}#0-45/691000.0/5336040.0/500.0/3.50`);
  await page.touchscreen.tap(195, 700);
  await page.waitForSelector("#info:not([hidden])");
  await page.waitForSelector(".map3d-marker");
  expect((await page.locator("#info dl").first().locator("dt").allTextContents()).slice(-3)).toEqual([
    "Elevation",
    "Coordinates",
    "Position",
  ]);
  const card = await page.locator("#info").boundingBox();
  await expect
    .poll(
      async () => {
        const pin = await page.locator(".map3d-marker").boundingBox();
        return (pin?.y ?? 0) + (pin?.height ?? 0) / 2 - (card?.y ?? 0);
      },
      { timeout: 10_000 },
    )
    .toBeLessThan(-30);
  await page.screenshot({ path: `${OUT}/phone-spot.png` });
  await page.locator("#info .close").tap();
  expect(await page.locator(".map3d-marker").count()).toBe(0);
  expect(problems).toEqual([]);
});

test.each(["en-GB", "de-DE", "fr-FR"])("at 320 pixels in %s, nothing overlaps and every word fits", async (locale) => {
  const { page, problems } = await open({ ...PHONE, viewport: { width: 320, height: 640 }, locale });
  await page.waitForSelector(".map3d-panel-button");
  const check = async (state: string): Promise<void> => {
    await page.screenshot({ path: `${OUT}/narrow-${locale}-${state}.png` });
    const wrong = await page.evaluate(() => {
      const shown = (selector: string): HTMLElement[] =>
        [...document.querySelectorAll<HTMLElement>(selector)].filter(
          (found) => found.getClientRects().length > 0 && getComputedStyle(found).clipPath === "none",
        );
      const words = shown("button, .modes label, dt, dd, output, .note, h1").filter(
        (found) => found.scrollWidth > found.clientWidth + 1 && getComputedStyle(found).display !== "inline",
      );
      const panels = shown(".head, .settings, .map3d-group, .map3d-profile").map(
        (found) => [found.className, found.getBoundingClientRect()] as const,
      );
      const pairs = panels.flatMap(([name, a], k) =>
        panels
          .slice(k + 1)
          .filter(([, b]) => a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1)
          .map(([other]) => `${name} over ${other}`),
      );
      return [
        ...words.map((found) => found.outerHTML.slice(0, 90)),
        ...pairs,
        ...panels.filter(([, { left, right }]) => left < 0 || right > innerWidth).map(([name]) => `${name} leaves the screen`),
      ];
    });
    expect(wrong, state).toEqual([]);
  };
  await check("start");
  expect(
    await page.evaluate(
      () =>
        [...document.querySelectorAll(".card")]
          .map((card) => card.getBoundingClientRect())
          .reduce((sum, { width, height }) => sum + width * height, 0) /
        (innerWidth * innerHeight),
    ),
  ).toBeLessThan(0.25);
  await page.locator("#more").tap();
  await page.selectOption("#color-by", { index: 2 });
  await page.waitForSelector("#legend button");
  await check("more");
  await page.locator("#more").tap();
  await page.locator("#measure").tap();
  await check("measure");
  await page.locator("#measure-profile").tap();
  await page.waitForSelector(".map3d-measure", { state: "attached" });
  for (const [count, [x, y]] of [
    [90, 330],
    [190, 360],
  ].entries()) {
    await page.touchscreen.tap(x ?? 0, y ?? 0);
    await page.waitForFunction((wanted) => document.querySelectorAll(".map3d-measure circle").length > wanted, count);
  }
  await page.waitForSelector(".map3d-profile");
  await check("profile");
  expect(problems).toEqual([]);
});

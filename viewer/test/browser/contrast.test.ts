import { expect, test } from "vitest";
import { renderTown } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { animationsEnd } from "./page";

const bed = new TestBed({ town: renderTown(256, 0.38), small: renderTown() }, { draws: false });
const DESK = { viewport: { width: 1280, height: 800 } };

test.each([
  ["contrast", { ...DESK, contrast: "more" }],
  ["contrast-dark", { ...DESK, contrast: "more", colorScheme: "dark" }],
  ["forced", { ...DESK, forcedColors: "active" }],
  [
    "forced-phone",
    {
      viewport: { width: 390, height: 844 },
      deviceScaleFactor: 3,
      isMobile: true,
      hasTouch: true,
      forcedColors: "active",
      colorScheme: "dark",
    },
  ],
] as const)("%s: texts stand out, what is chosen and what has the focus is seen", async (name, options) => {
  const { page, problems } = await bed.openReadyMade(bed.url("town"), options);
  await page.waitForSelector(".map3d-overview-map", { state: "attached" });
  await page.locator("#measure").focus();
  await page.keyboard.press("Enter");
  await page.waitForSelector(".map3d-measure", { state: "attached" });
  await page.locator("#measure-height").focus();
  await page.keyboard.press("Tab");
  await animationsEnd(page);
  await page.screenshot({ path: `${OUT}/${name}.png` });
  const [faint, focus, pressed, plain] = await page.evaluate(() => {
    const channels = (color: string): number[] => (color.match(/[\d.]+/g) ?? []).map(Number);
    const bright = (color: string): number =>
      channels(color)
        .slice(0, 3)
        .map((c) => c / 255)
        .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
        .reduce((sum, c, k) => sum + c * ([0.2126, 0.7152, 0.0722][k] ?? 0), 0);
    const ratio = (a: string, b: string): number => {
      const [x, y] = [bright(a), bright(b)].sort((p, q) => q - p) as [number, number];
      return (x + 0.05) / (y + 0.05);
    };
    /** The element's background over those of its ancestors, opaque. */
    const behind = (element: Element | null): string => {
      if (!element) return "rgb(255, 255, 255)";
      const [r = 0, g = 0, b = 0, a = 1] = channels(getComputedStyle(element).backgroundColor);
      if (a === 1) return `rgb(${String(r)}, ${String(g)}, ${String(b)})`;
      const below = channels(behind(element.parentElement));
      return `rgb(${[r, g, b].map((c, k) => a * c + (1 - a) * (below[k] ?? 0)).join(", ")})`;
    };
    const seen = [
      ...document.querySelectorAll<HTMLElement>("h1, .note, button, label, .map3d-attribution, .map3d-scale span, output"),
    ].filter((found) => found.getClientRects().length > 0 && !found.matches(":disabled, .skip"));
    const low = seen
      .filter((found) => found.textContent.trim() !== "")
      .map((found) => [ratio(getComputedStyle(found).color, behind(found)), found.outerHTML.slice(0, 60)] as const)
      .filter(([value]) => value < 7);
    const active = getComputedStyle(document.activeElement as Element);
    const [on, off] = ["#measure-line", "#measure-area"].map(
      (id) => getComputedStyle(document.querySelector(id) as Element).backgroundColor,
    );
    return [
      low,
      [
        active.outlineStyle,
        parseFloat(active.outlineWidth),
        ratio(active.outlineColor, behind(document.activeElement?.parentElement ?? null)),
      ] as const,
      on,
      off,
    ] as const;
  });
  expect(faint).toEqual([]);
  expect(focus[0]).toBe("solid");
  expect(focus[1]).toBeGreaterThanOrEqual(3);
  expect(focus[2]).toBeGreaterThan(3);
  expect(pressed).not.toBe(plain);
  expect(problems).toEqual([]);
});

test("a user who saves data gets coarser tiles on a dense screen, no ids for hovering, and a notice", async () => {
  const deepest = { saved: 0, full: 0 };
  for (const kind of ["saved", "full"] as const) {
    const { page } = await bed.openPage({ viewport: { width: 390, height: 844 }, deviceScaleFactor: 3, isMobile: true });
    if (kind === "saved")
      await page.addInitScript(() => {
        Object.defineProperty(navigator, "connection", { value: { saveData: true } });
      });
    await page.goto(`${bed.server.origin}/?rendering=${bed.url("town")}`);
    await page.waitForSelector("#tools:not([hidden])");
    expect(await page.locator("#data-saver").isVisible()).toBe(kind === "saved");
    if (kind === "saved") await page.screenshot({ path: `${OUT}/saving.png` });
    await page.context().close();
  }
  for (const kind of ["saved", "full"] as const) {
    bed.server.requests.length = 0;
    const { page } = await bed.start(
      "small",
      { zoom: -9, dataSaver: kind === "saved" },
      {},
      { viewport: { width: 390, height: 844 }, deviceScaleFactor: 3 },
    );
    deepest[kind] = Math.max(...bed.server.requests.flatMap((url) => /\/color\/(\d+)\//.exec(url)?.[1] ?? []).map(Number));
    await page.context().close();
  }
  expect(deepest.saved).toBe(deepest.full - 1);
  bed.server.requests.length = 0;
  const { page } = await bed.start("town", { dataSaver: true, hover: true });
  const light = await page.evaluate(
    () => (globalThis as unknown as { map: { light: { shadows: boolean; occlusion: boolean } } }).map.light,
  );
  expect([light.shadows, light.occlusion]).toEqual([false, false]);
  expect(bed.server.requests.filter((url) => url.includes("/id/"))).toEqual([]);
});

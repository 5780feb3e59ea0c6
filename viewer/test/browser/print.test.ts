import { readFileSync, writeFileSync } from "node:fs";
import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Print from "../../src/print";
import { renderTown } from "../fixture/rendering";
import { decodePng, type DecodedPng } from "../../src/core/png";
import { ORIGIN } from "../fixture/town";
import { rows } from "./rows";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { picture, settled, type Global } from "./page";

const town = renderTown();
const bed = new TestBed({ town, fine: renderTown(256, 0.38) });
const undrawn = new TestBed(bed.server, { draws: false });
type Printing = Global & { map3d: typeof Print };
const BARE = { scaleBar: false, northArrow: false, attribution: "", background: "transparent", markers: false };

/** A picture's size and its RGBA bytes. */
async function exported(page: Page, options: object, path?: string): Promise<{ width: number; height: number; bytes: Buffer }> {
  const [width, height, text, file] = await page.evaluate(async (given) => {
    const g = globalThis as unknown as Printing;
    const blob = await g.map3d.exportPicture(g.map, given);
    const bitmap = await createImageBitmap(blob, { premultiplyAlpha: "none" });
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d") as OffscreenCanvasRenderingContext2D;
    context.drawImage(bitmap, 0, 0);
    const base64 = (bytes: Uint8Array | Uint8ClampedArray): string => {
      let out = "";
      for (let k = 0; k < bytes.length; k += 8192) out += String.fromCharCode(...bytes.subarray(k, k + 8192));
      return btoa(out);
    };
    return [
      bitmap.width,
      bitmap.height,
      base64(context.getImageData(0, 0, bitmap.width, bitmap.height).data),
      base64(new Uint8Array(await blob.arrayBuffer())),
    ] as const;
  }, options);
  if (path !== undefined) writeFileSync(path, Buffer.from(file, "base64"));
  return { width, height, bytes: Buffer.from(text, "base64") };
}

test.each(["webgl", "canvas"])("%s: a picture of the screen's size equals the screen; a wider one has no seams", async (drawer) => {
  const { page, problems } = await bed.start("town", { zoom: 3, drawer }, {}, { viewport: { width: 700, height: 500 } });
  await page.addScriptTag({ url: "/map3d-print.js" });
  await settled(page, (id) => (globalThis as Global).layer.setStyle({ colors: new Map([[id, "#1389a0"]]) }).highlight(1025), 17);
  const screen = await picture(page);
  const same = await exported(page, { ...BARE, scale: 1 });
  expect([same.width, same.height]).toEqual([700, 500]);
  let most = 0;
  for (let k = 0; k < screen.length; k++)
    if ((screen[k | 3] ?? 0) === 255) most = Math.max(most, Math.abs((screen[k] ?? 0) - (same.bytes[k] ?? 0)));
  expect(most).toBeLessThanOrEqual(1);
  // Wider, so that it consists of two pieces: the part on the screen is the same across their seam.
  const wide = await exported(page, { ...BARE, width_px: 1600, height_px: 500 });
  expect([wide.width, wide.height]).toEqual([1600, 500]);
  let [off, crossed] = [0, 0];
  for (let y = 0; y < 500; y++) {
    for (let x = 0; x < 700; x++) {
      const [a, b] = [4 * (700 * y + x), 4 * (1600 * y + x + 450)];
      if (screen[a + 3] !== 255) continue;
      if (x + 450 >= 1024) crossed++;
      if ([0, 1, 2, 3].some((k) => Math.abs((screen[a + k] ?? 0) - (wide.bytes[b + k] ?? 0)) > 1)) off++;
    }
  }
  expect(crossed).toBeGreaterThan(1_000);
  expect(off).toBe(0);
  expect(await page.locator(".map3d").count()).toBe(1);
  expect(problems).toEqual([]);
});

test("title, legend, markers, scale bar and attribution are drawn; invalid options, an abort and a failed tile reject", async () => {
  const { page } = await undrawn.start("fine", { zoom: 1.4 }, {}, { viewport: { width: 400, height: 280 } });
  await page.addScriptTag({ url: "/map3d-print.js" });
  await page.evaluate(
    (at) => {
      const g = globalThis as Global;
      new g.map3d.marker("Tower", at).addTo(g.map);
    },
    [ORIGIN[0] + 32, ORIGIN[1] + 26, ORIGIN[2] + 62] as const,
  );
  const failed = (options: object): Promise<string> =>
    page.evaluate(async (given) => {
      const g = globalThis as unknown as Printing;
      const stop = new AbortController();
      const signal =
        "stop" in given
          ? {
              signal: stop.signal,
              progress: () => {
                stop.abort(new Error("enough"));
              },
            }
          : {};
      return g.map3d.exportPicture(g.map, { ...given, ...signal }).then(
        () => "a picture",
        (reason: unknown) => String(reason),
      );
    }, options);
  // Before the browser has them: a picture twice as large needs tiles that the screen does not.
  bed.server.failures.set("/color/2/", 1e9);
  const lost = await failed({ scale: 2 });
  bed.server.failures.clear();
  expect(lost).toMatch(/^FetchError: .*HTTP 503/);
  const legend = {
    title: "Height",
    classes: [
      { label: "low", color: "#ff0000" },
      { label: "high", color: "#00ff00" },
    ],
  };
  const { width, height, bytes } = await exported(
    page,
    { width_px: 1754, height_px: 1240, title: "A small town", legend, textScale: 1.5625 },
    `${OUT}/print-a4.png`,
  );
  expect([width, height]).toEqual([1754, 1240]);
  const has = (color: readonly number[]): boolean => {
    for (let k = 0; k < bytes.length; k += 4) if (color.every((part, j) => bytes[k + j] === part)) return true;
    return false;
  };
  expect([has([255, 0, 0, 255]), has([0, 255, 0, 255])]).toEqual([true, true]);
  expect(await failed({ width_px: 9000, height_px: 20 })).toBe(
    "UsageError: the picture's width must be a whole number from 1 to 8192 pixels, got 9000",
  );
  expect(await failed({ background: "url(x)" })).toBe('UsageError: background must be a CSS colour, got "url(x)"');
  expect(await failed({ scale: 4, stop: true })).toBe("Error: enough");
  expect(await page.locator(".map3d").count()).toBe(1);
});

test("an overlay is drawn over the map and below the texts, in CSS pixels of the map", async () => {
  const { page } = await undrawn.start("town", { zoom: 1.4 }, {}, { viewport: { width: 200, height: 100 } });
  await page.addScriptTag({ url: "/map3d-print.js" });
  const found = await page.evaluate(async (bare) => {
    const g = globalThis as unknown as Printing;
    const overlay = (context: CanvasRenderingContext2D): void => {
      context.fillStyle = "#ff00ff";
      context.globalAlpha = 1;
      context.fillRect(10, 20, 30, 40);
    };
    // Twice as large, and 300 pixels wider than the map.
    const bitmap = await createImageBitmap(await g.map3d.exportPicture(g.map, { ...bare, width_px: 700, height_px: 200, overlay }));
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d") as OffscreenCanvasRenderingContext2D;
    context.drawImage(bitmap, 0, 0);
    return [
      [170, 40],
      [229, 119],
      [169, 40],
      [230, 119],
      [170, 39],
      [229, 120],
    ].map(([x = 0, y = 0]) => context.getImageData(x, y, 1, 1).data.join() === "255,0,255,255");
  }, BARE);
  expect(found).toEqual([true, true, false, false, false, false]);
});

const DESK = { viewport: { width: 1280, height: 800 } };
const PHONE = { viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, isMobile: true, hasTouch: true };

test.each(rows([["phone", PHONE]] as const, [["desk", DESK]] as const))(
  "%s: the page saves and prints the view with title, legend and attribution",
  async (name, options) => {
    const { page, problems } = await bed.openPage({ ...options, acceptDownloads: true });
    await page.addInitScript(() => {
      window.print = () => {
        document.title = "printed";
      };
    });
    await page.goto(`${bed.server.origin}/?rendering=${bed.url("fine")}`);
    await page.waitForSelector("#make-picture");
    if (name === "phone") await page.locator("#more").tap();
    await page.selectOption("#color-by", { label: "measuredHeight" });
    await page.waitForSelector("#legend button");
    if (name === "phone") await page.locator("#more").tap();
    await page.locator("#make-picture").click();
    await page.selectOption("#picture-size", { index: name === "desk" ? 0 : 1 });
    await page.screenshot({ path: `${OUT}/${name}-picture.png` });
    expect(await page.locator("#picture-note").textContent()).toBe(name === "desk" ? "1280 × 800 px" : "780 × 1688 px");
    const [download] = await Promise.all([page.waitForEvent("download"), page.locator("#picture-save").click()]);
    expect(download.suggestedFilename()).toBe("town-0-45.png");
    await download.saveAs(`${OUT}/${name}-saved.png`);
    expect(readFileSync(`${OUT}/${name}-saved.png`).readUInt32BE(16)).toBe(name === "desk" ? 1280 : 780);
    await page.waitForSelector("#picture", { state: "hidden" });
    if (name === "desk") {
      // The saved picture fades towards the edge as the screen does.
      const [saved, screen] = [
        await decodePng(Uint8Array.from(readFileSync(`${OUT}/desk-saved.png`))),
        await decodePng(Uint8Array.from(await page.screenshot())),
      ];
      const row = ({ width, channels, data }: DecodedPng): number[] =>
        Array.from({ length: 70 }, (_, k) => data[channels * (450 * width + 850 + k)] ?? NaN);
      const [a, b] = [row(saved), row(screen)];
      expect(a.filter((value, k) => Math.abs(value - (b[k] ?? NaN)) <= 4).length).toBeGreaterThan(0.95 * a.length);
      expect(new Set(a).size).toBeGreaterThan(8);
      expect(await page.locator(".haze.shown").count()).toBe(1);
    }
    await page.locator("#make-picture").click();
    await page.locator("#picture-print").click();
    await page.waitForFunction(() => document.title === "printed");
    await page.emulateMedia({ media: "print" });
    await page.screenshot({ path: `${OUT}/${name}-print.png` });
    const sheet = (await page.locator("#sheet").innerText()).replace(/\s+/g, " ");
    for (const part of [
      "A small town",
      "measuredHeight",
      "62",
      "Made by hand",
      "Coordinate system: ETRS89 / UTM zone 32N",
      String(new Date().getFullYear()),
    ])
      expect(sheet).toContain(part);
    // As after printing, when the sheet is removed.
    await page.pdf({ path: `${OUT}/${name}-print.pdf`, preferCSSPageSize: true, printBackground: false });
    await page.emulateMedia({ media: null });
    expect(await page.locator("#sheet > *").count()).toBe(0);
    // Stopped half-way: the dialog is closed, nothing is saved, and the export can be started again.
    await page.locator("#make-picture").click();
    await page.selectOption("#picture-size", { index: 3 });
    await page.locator("#picture-save").click();
    await page.waitForSelector("#picture-busy:not([hidden])");
    await page.screenshot({ path: `${OUT}/${name}-picture-working.png` });
    await page.keyboard.press("Escape");
    await page.waitForSelector("#picture-busy", { state: "hidden" });
    await page.locator("#make-picture").click();
    expect(await page.locator("#picture-save").isEnabled()).toBe(true);
    expect(problems).toEqual([]);
  },
);

import type { Page } from "playwright-core";
import { decodePng, type DecodedPng } from "../../src/core/png";
/** Functions that run in the page. map3d is the global of dist/map3d.js. */
import type * as M from "../../src/map3d";

/** A bare page with the canvas of README's example. */
export const BARE =
  '<!doctype html><html><head><meta charset="utf-8"><title>test</title><link rel="icon" href="data:,"><link rel="stylesheet" href="/bare.css"></head><body><canvas id="mapcanvas"></canvas><script src="/map3d.js"></script></body></html>';

export interface Started {
  map: M.map;
  layer: M.imageLayer;
}

export type Global = typeof globalThis & Started & { errors: string[]; clicks: M.ClickEvent[]; map3d: typeof M };

/** Creates a map in the bare page and waits until it rests. */
export function begin([urls, mapOptions, layerOptions]: readonly [string | string[], object, object]): Promise<void> {
  return new Promise((done) => {
    const g = globalThis as Global;
    g.map = new g.map3d.map("mapcanvas", { preserveDrawingBuffer: true, ...mapOptions });
    g.layer = new g.map3d.imageLayer(urls, layerOptions).addTo(g.map);
    g.errors = [];
    g.clicks = [];
    g.map.on("error", ({ error }) => g.errors.push(error.message));
    g.map.on("click", (event) => g.clicks.push(event));
    g.map.once("idle", () => {
      done();
    });
  });
}

/** Runs a function in the page and waits until the map rests again. */
export function settled<A>(page: Page, act: (argument: A) => unknown, argument: A): Promise<void> {
  return page.evaluate(
    ([code, given]) =>
      new Promise<void>((done) => {
        (globalThis as Global).map.once("idle", () => {
          done();
        });
        (globalThis as unknown as { eval(code: string): (argument: unknown) => unknown }).eval(code)(given);
      }),
    [`(${act.toString()})`, argument] as const,
  );
}

/** Waits until the map has drawn everything in view and nothing moves. */
export const drawn = (page: Page): Promise<unknown> => page.waitForFunction(() => (globalThis as Global).map.loaded());

/** Waits until all transitions of the page's styles have ended. */
export const animationsEnd = (page: Page): Promise<unknown> =>
  page.waitForFunction(() =>
    document.getAnimations().every((each) => each.playState !== "running" || each.effect?.getComputedTiming().iterations === Infinity),
  );

/** Reads until a value stays the same, and returns it. @param times how often it is read again */
export async function steady<T>(page: Page, read: () => Promise<T>, times = 1): Promise<T> {
  const text = (value: T): string => (Buffer.isBuffer(value) ? value.toString("base64") : JSON.stringify(value));
  let value = await read();
  for (let same = 0; same < times;) {
    await page.waitForTimeout(100);
    const now = await read();
    same = text(now) === text(value) ? same + 1 : 0;
    value = now;
  }
  return value;
}

/** Clicks or taps, by page. */
const lastTaps = new WeakMap<Page, { at: readonly [number, number]; ms: number }>();
/** More than the time and distance between the taps of a double tap. */
const [APART_MS, APART_PX] = [400, 40];

/** Waits while a tap at a point would make the last one a double tap. */
export async function tapApart(page: Page, at: readonly [number, number]): Promise<void> {
  const last = lastTaps.get(page);
  const left_ms = last && Math.hypot(at[0] - last.at[0], at[1] - last.at[1]) < APART_PX ? last.ms + APART_MS - performance.now() : 0;
  if (left_ms > 0) await page.waitForTimeout(left_ms);
  lastTaps.set(page, { at, ms: performance.now() });
}

/** Returns the canvas's pixels as RGBA bytes, from the top. */
export async function pixels(page: Page): Promise<Buffer> {
  const text = await page.evaluate(() => {
    const { canvas } = (globalThis as Global).map;
    const gl = canvas.getContext("webgl2");
    const [row, height] = [4 * canvas.width, canvas.height];
    const data = gl
      ? new Uint8Array(row * height)
      : (canvas.getContext("2d")?.getImageData(0, 0, canvas.width, height).data ?? new Uint8ClampedArray());
    gl?.readPixels(0, 0, canvas.width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    let out = "";
    for (let k = 0, j = gl ? height - 1 : 0; k < height; k++, j += gl ? -1 : 1)
      for (let i = 0; i < row; i += 400) out += String.fromCharCode(...data.subarray(row * j + i, row * j + Math.min(i + 400, row)));
    return btoa(out);
  });
  return Buffer.from(text, "base64");
}

/** Returns the picture as RGBA bytes with straight alpha, from the top, whatever the drawer. */
export async function picture(page: Page): Promise<Buffer> {
  const text = await page.evaluate(() => {
    const { canvas } = (globalThis as Global).map;
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d") as OffscreenCanvasRenderingContext2D;
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    let out = "";
    for (let k = 0; k < data.length; k += 8192) out += String.fromCharCode(...data.subarray(k, k + 8192));
    return btoa(out);
  });
  return Buffer.from(text, "base64");
}

/** Decodes a PNG file. */
export const decoded = (png: Uint8Array): Promise<DecodedPng> => decodePng(Uint8Array.from(png));

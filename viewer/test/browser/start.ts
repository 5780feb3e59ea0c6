import type { Browser, BrowserContextOptions, Page } from "playwright-core";
import type { TestServer } from "../fixture/server";
import { openPage } from "./browser";
import { BARE, type Global } from "./page";

export function addBarePage(server: TestServer): void {
  server.pages.set("/bare", BARE);
  server.pages.set("/bare.css", "html,body{margin:0;height:100%}#mapcanvas{width:100%;height:100vh}");
}

/** A page with a map of a rendering that has drawn its first complete view and rests. */
export async function start(browser: Browser, bases: string | string[], options: object = {}, layer: object = {}, context: BrowserContextOptions = {}): Promise<{ page: Page; problems: string[] }> {
  const opened = await openPage(browser, context);
  const first = typeof bases === "string" ? bases : (bases[0] ?? "");
  await opened.page.goto(`${new URL(first).origin}/bare`);
  await opened.page.evaluate(([urls, mapOptions, layerOptions]) => new Promise<void>((done) => {
    const g = globalThis as Global;
    g.map = new g.map3d.map("mapcanvas", { preserveDrawingBuffer: true, ...mapOptions });
    g.layer = new g.map3d.imageLayer(urls, layerOptions).addTo(g.map);
    g.errors = [];
    g.clicks = [];
    g.map.on("error", ({ error }) => g.errors.push(error.message));
    g.map.on("click", (event) => g.clicks.push(event));
    g.map.once("idle", () => { done(); });
  }), [bases, options, layer] as const);
  return opened;
}

/** Does something in the page and waits until the map rests again. */
export function settled<A>(page: Page, act: (argument: A) => unknown, argument: A): Promise<void> {
  return page.evaluate(([code, given]) => new Promise<void>((done) => {
    (globalThis as Global).map.once("idle", () => { done(); });
    (globalThis as unknown as { eval(code: string): (argument: unknown) => unknown }).eval(code)(given);
  }), [`(${act.toString()})`, argument] as const);
}

/** Pixels of the canvas as RGBA bytes, from the top. */
export async function pixels(page: Page): Promise<Buffer> {
  const text = await page.evaluate(() => {
    const { canvas } = (globalThis as Global).map;
    const gl = canvas.getContext("webgl2");
    const [row, height] = [4 * canvas.width, canvas.height];
    const data = gl ? new Uint8Array(row * height) : canvas.getContext("2d")?.getImageData(0, 0, canvas.width, height).data ?? new Uint8ClampedArray();
    gl?.readPixels(0, 0, canvas.width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    let out = "";
    for (let k = 0, j = gl ? height - 1 : 0; k < height; k++, j += gl ? -1 : 1) for (let i = 0; i < row; i += 400) out += String.fromCharCode(...data.subarray(row * j + i, row * j + Math.min(i + 400, row)));
    return btoa(out);
  });
  return Buffer.from(text, "base64");
}

/** The picture as RGBA bytes with straight alpha, from the top, whatever draws it. */
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

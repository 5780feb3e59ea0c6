import { mkdirSync } from "node:fs";
import { resolve } from "node:path";
import { chromium, type Browser, type BrowserContext, type BrowserContextOptions, type Page, type Request } from "playwright-core";
import { recordDrawing } from "./recordingContext";

export const OUT = resolve(import.meta.dirname, "../../.shots");
mkdirSync(OUT, { recursive: true });

/** Ways to start Chromium: their arguments and environment variables. */
const WAYS = {
  /** Composes pages without WebGL: a screenshot of a moving page takes a twentieth of the time. */
  plain: { args: ["--disable-gpu-compositing", "--disable-gpu-rasterization"], env: {} },
  /** As most users have it, with texts and scaled pictures as in golden pictures. */
  exact: { args: [], env: { FONTCONFIG_FILE: resolve(import.meta.dirname, "../golden/fonts.conf") } },
} as const;
export type Way = keyof typeof WAYS;

/** Opens Chromium with software WebGL2. */
async function openBrowser(way: Way): Promise<Browser> {
  const args = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    ...WAYS[way].args,
  ];
  return chromium.launch({
    executablePath: resolve(import.meta.dirname, "chromium.sh"),
    headless: true,
    args,
    env: { ...process.env, ...WAYS[way].env },
  });
}

/** The browsers of this process, which all its test files share. They end with it. */
const browsers = new Map<Way, Promise<Browser>>();
function browserOf(way: Way): Promise<Browser> {
  const browser = browsers.get(way) ?? openBrowser(way);
  browsers.set(way, browser);
  return browser;
}

/** Contexts that the current test has opened. */
const opened = new Set<BrowserContext>();

/** Closes what a test has opened through `openPage`. @throws Error when another context is left */
export async function closePages(): Promise<void> {
  for (const context of opened) await context.close();
  opened.clear();
  const left = (await Promise.all(browsers.values())).flatMap((browser) => browser.contexts());
  for (const context of left) await context.close();
  if (left.length > 0) throw new Error(`the test left ${String(left.length)} contexts open`);
}

/** Hides that these browsers have no GPU, so that maps use WebGL as they do for most users. */
function anyWebGL(): void {
  const own = Object.getOwnPropertyDescriptor(HTMLCanvasElement.prototype, "getContext")?.value as (
    kind: string,
    options?: object,
  ) => unknown;
  HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, options?: object) {
    return own.call(this, kind, options && { ...options, failIfMajorPerformanceCaveat: false });
  } as typeof HTMLCanvasElement.prototype.getContext;
  const tell = Object.getOwnPropertyDescriptor(WebGL2RenderingContext.prototype, "getParameter")?.value as (name: number) => unknown;
  WebGL2RenderingContext.prototype.getParameter = function (this: WebGL2RenderingContext, name: number): unknown {
    return name === 0x9246 ? "a GPU" : tell.call(this, name); // UNMASKED_RENDERER_WEBGL
  };
}

/** Makes the ready-made page open at once, as in a session that has seen its opening. */
function skipOpening(): void {
  try {
    sessionStorage.setItem("map3d-opening", "");
  } catch {
    // A page without storage, such as about:blank.
  }
}

/** Collects the maps of a page in `maps`. Its modules share one core. */
const COLLECT_MAPS = `globalThis.maps = new Set();
if (location.protocol.startsWith("http")) import("/map3d.module.js").then(({ map: { prototype } }) => {
  const { fire } = prototype;
  prototype.fire = function (type, fields) {
    if (type === "remove") maps.delete(this);
    else maps.add(this);
    return fire.call(this, type, fields);
  };
}, () => undefined);`;

/** Requests without an answer, by page. */
const waiting = new WeakMap<Page, Set<Request>>();

/** Waits until all requests of a page are answered. */
export async function answered(page: Page): Promise<void> {
  while (waiting.get(page)?.size) await page.waitForTimeout(50);
}

/** Waits until all requests of a page are answered and the map of the bare page, `map`, shows what came. */
export async function loaded(page: Page): Promise<void> {
  do {
    await answered(page);
    await page.waitForFunction(() => (globalThis as unknown as { map: { loaded(): boolean } }).map.loaded());
  } while (waiting.get(page)?.size);
}

/** Waits until the maps of a ready-made page are drawn, and nothing moves or loads. */
export async function resting(page: Page): Promise<void> {
  for (let calm = 0; calm < 2;) {
    const drawn = await page.evaluate(
      () =>
        new Promise<boolean>((done) => {
          const { maps } = globalThis as unknown as { maps: Set<{ loaded(): boolean }> };
          requestAnimationFrame(() =>
            setTimeout(() => {
              done(maps.size > 0 && [...maps].every((map) => map.loaded()));
            }, 30),
          );
        }),
    );
    calm = drawn && waiting.get(page)?.size === 0 ? calm + 1 : 0;
  }
}

/** Chromium's remark on reading a WebGL picture to compose the page. */
const STALL = /GPU stall due to ReadPixels/;

export interface PageOptions {
  readonly way?: Way;
  /** Whether WebGL draws. Default: true; false records the calls. */
  readonly draws?: boolean;
  /** Collects its maps, for `resting`. */
  readonly maps?: boolean;
  /** Plays the opening of the ready-made page. */
  readonly opening?: boolean;
}

/** Opens a page and collects its errors and console errors. `closePages` closes it. */
export async function openPage(
  options: BrowserContextOptions = {},
  { way = "plain", draws = true, maps = false, opening = false }: PageOptions = {},
): Promise<{ page: Page; problems: string[] }> {
  const browser = await browserOf(way);
  const context = await browser.newContext({ viewport: { width: 800, height: 600 }, ...options });
  opened.add(context);
  await context.addInitScript(draws ? anyWebGL : recordDrawing);
  if (maps) await context.addInitScript(COLLECT_MAPS);
  if (!opening) await context.addInitScript(skipOpening);
  const page = await context.newPage();
  const requests = new Set<Request>();
  waiting.set(page, requests);
  page.on("request", (request) => requests.add(request));
  page.on("requestfinished", (request) => requests.delete(request));
  page.on("requestfailed", (request) => requests.delete(request));
  const problems: string[] = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("console", (message) => {
    if ((message.type() === "error" || message.type() === "warning") && !STALL.test(message.text())) problems.push(message.text());
  });
  page.setDefaultTimeout(60_000);
  return { page, problems };
}

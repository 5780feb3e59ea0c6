import { mkdirSync } from "node:fs";
import { resolve } from "node:path";
import { chromium, type Browser, type BrowserContextOptions, type Page } from "playwright-core";

export const OUT = resolve(import.meta.dirname, "../../.shots");
mkdirSync(OUT, { recursive: true });

/** Opens Chromium with software WebGL2. Path: CHROMIUM, else Debian's. @param env additional environment variables */
export async function openBrowser(env: Record<string, string> = {}): Promise<Browser> {
  const args = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"];
  return chromium.launch({ executablePath: process.env["CHROMIUM"] ?? "/usr/bin/chromium", headless: true, args, env: { ...process.env, ...env } });
}

/** Hides that these browsers have no GPU, so that maps use WebGL as they do for most users. */
function anyWebGL(): void {
  const own = Object.getOwnPropertyDescriptor(HTMLCanvasElement.prototype, "getContext")?.value as (kind: string, options?: object) => unknown;
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

/** Opens a page and collects its errors and console errors. @param opening plays the opening of the ready-made page */
export async function openPage(browser: Browser, options: BrowserContextOptions = {}, opening = false): Promise<{ page: Page; problems: string[] }> {
  const context = await browser.newContext({ viewport: { width: 800, height: 600 }, ...options });
  await context.addInitScript(anyWebGL);
  if (!opening) await context.addInitScript(skipOpening);
  const page = await context.newPage();
  const problems: string[] = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warning") problems.push(message.text());
  });
  page.setDefaultTimeout(90_000);
  return { page, problems };
}

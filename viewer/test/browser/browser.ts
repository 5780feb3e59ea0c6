import { mkdirSync } from "node:fs";
import { resolve } from "node:path";
import { chromium, type Browser, type BrowserContextOptions, type Page } from "playwright-core";

export const OUT = resolve(import.meta.dirname, "../../.shots");
mkdirSync(OUT, { recursive: true });

/** Chromium with software WebGL2. Its path: CHROMIUM, else Debian's. @param env what it is told besides this process's environment */
export async function openBrowser(env: Record<string, string> = {}): Promise<Browser> {
  const args = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"];
  return chromium.launch({ executablePath: process.env["CHROMIUM"] ?? "/usr/bin/chromium", headless: true, args, env: { ...process.env, ...env } });
}

/** A page whose errors and console errors fail the test that looks at them. */
export async function openPage(browser: Browser, options: BrowserContextOptions = {}): Promise<{ page: Page; problems: string[] }> {
  const context = await browser.newContext({ viewport: { width: 800, height: 600 }, ...options });
  const page = await context.newPage();
  const problems: string[] = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warning") problems.push(message.text());
  });
  page.setDefaultTimeout(90_000);
  return { page, problems };
}

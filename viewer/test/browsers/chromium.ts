import type { Browser, Page } from "playwright-core";
import { openBrowser, openPage } from "../browser/browser";
import { Driver } from "./driver";

/** Chromium, whose pictures are the reference. It accepts no input. */
export class Chromium extends Driver {
  private constructor(private readonly browser: Browser, private readonly page: Page, readonly complaints: readonly string[]) {
    super();
  }

  static async start(): Promise<Chromium> {
    const browser = await openBrowser();
    const { page, problems } = await openPage(browser);
    return new Chromium(browser, page, problems);
  }

  async open(url: string): Promise<void> {
    await this.page.goto(url);
  }

  async perform(): Promise<void> {
    await this.page.waitForTimeout(0);
  }

  run(expression: string): Promise<unknown> {
    return this.page.evaluate(expression);
  }

  close(): Promise<void> {
    return this.browser.close();
  }

  protected capture(): Promise<Buffer> {
    return this.page.screenshot();
  }
}

import type { Page } from "playwright-core";
import { closePages, openPage } from "../browser/browser";
import { Driver } from "./driver";

/** Chromium, whose pictures are the reference. It accepts no input. */
export class Chromium extends Driver {
  private constructor(
    private readonly page: Page,
    readonly complaints: readonly string[],
  ) {
    super();
  }

  static async start(): Promise<Chromium> {
    const { page, problems } = await openPage();
    return new Chromium(page, problems);
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
    return closePages();
  }

  protected capture(): Promise<Buffer> {
    return this.page.screenshot();
  }
}

import type { Page } from "playwright-core";
import type { Vec2 } from "../../src/core/vec";
import { tapApart } from "./page";

/** Maximum number of actions of a task after opening. */
export const MAX_ACTIONS = 3;

/** A user whose actions are counted. */
export class CountedActions {
  count = 0;
  /** When the first action began, ms. */
  begun: number | undefined;
  readonly #page: Page;

  constructor(page: Page) {
    this.#page = page;
  }

  async tap(target: string | Vec2): Promise<void> {
    this.#act(1);
    if (typeof target === "string") {
      await this.#page.locator(target).tap();
      return;
    }
    await tapApart(this.#page, target);
    await this.#page.touchscreen.tap(...target);
  }

  type(text: string): Promise<void> {
    this.#act(1);
    return this.#page.keyboard.type(text);
  }

  key(name: string): Promise<void> {
    this.#act(1);
    return this.#page.keyboard.press(name);
  }

  /** A native select list: one tap opens it, another chooses. */
  async choose(select: string, label: string): Promise<void> {
    this.#act(2);
    await this.#page.selectOption(select, { label });
  }

  /** Drags across the screen. */
  async drag(from: Vec2, to: Vec2): Promise<void> {
    this.#act(1);
    await this.#page.mouse.move(...from);
    await this.#page.mouse.down();
    await this.#page.mouse.move(...to, { steps: 8 });
    await this.#page.mouse.up();
  }

  #act(actions: number): void {
    this.begun ??= performance.now();
    this.count += actions;
    if (this.count > MAX_ACTIONS) throw new Error(`${String(this.count)} actions; a task may take ${String(MAX_ACTIONS)} at most`);
  }
}

/** Makes a page as slow as an inexpensive phone on a mobile network: a processor four times slower than this one, 10 Mbit/s, 40 ms to the server. Chromium only. */
export async function throttle(page: Page): Promise<void> {
  const session = await page.context().newCDPSession(page);
  await session.send("Emulation.setCPUThrottlingRate", { rate: 4 });
  await session.send("Network.emulateNetworkConditions", {
    offline: false,
    latency: 40,
    downloadThroughput: 10e6 / 8,
    uploadThroughput: 2e6 / 8,
  });
}

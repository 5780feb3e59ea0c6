import type { Page } from "playwright-core";
import type { Vec2 } from "../../src/core/vec";
import { decodePng, type DecodedPng } from "../../src/tiles/png";

/** Actions that a task may take after opening. */
export const MOST = 3;
/** Longer than a double tap. */
const APART_MS = 600;

/** A reader's hand, whose actions are counted. */
export class Hand {
  count = 0;
  readonly #page: Page;

  constructor(page: Page) {
    this.#page = page;
  }

  async tap(target: string | Vec2): Promise<void> {
    this.#act(1);
    if (typeof target === "string") await this.#page.locator(target).tap();
    else await this.#page.touchscreen.tap(...target);
    await this.#page.waitForTimeout(APART_MS);
  }

  async type(text: string): Promise<void> {
    this.#act(1);
    await this.#page.keyboard.type(text);
    await this.#page.waitForTimeout(APART_MS);
  }

  key(name: string): Promise<void> {
    this.#act(1);
    return this.#page.keyboard.press(name);
  }

  /** A list of the device's own: a tap opens it, another one chooses. */
  async choose(select: string, label: string): Promise<void> {
    this.#act(2);
    await this.#page.selectOption(select, { label });
  }

  /** Along the screen, from a place to another. */
  async drag(from: Vec2, to: Vec2): Promise<void> {
    this.#act(1);
    await this.#page.mouse.move(...from);
    await this.#page.mouse.down();
    await this.#page.mouse.move(...to, { steps: 8 });
    await this.#page.mouse.up();
  }

  #act(actions: number): void {
    this.count += actions;
    if (this.count > MOST) throw new Error(`${String(this.count)} actions: a task takes ${String(MOST)} at most`);
  }
}

/** The pixels of a PNG file. */
export const decoded = (png: Uint8Array): Promise<DecodedPng> => decodePng(Uint8Array.from(png));

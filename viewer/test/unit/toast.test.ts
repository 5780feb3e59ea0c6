import { afterEach, beforeEach, expect, test, vi } from "vitest";
import type * as Toast from "../../page/toast";

/** As much of an element as toasts need. */
class Box {
  textContent = "";
  className = "";
  children: Box[] = [];
  #parent: Box | undefined;
  append(...added: Box[]): void {
    for (const box of added) box.#parent = this;
    this.children.push(...added);
  }
  remove(): void {
    const siblings = this.#parent?.children ?? [];
    siblings.splice(siblings.indexOf(this), 1);
  }
  get firstElementChild(): Box | undefined {
    return this.children[0];
  }
  addEventListener(): void {
    /* its button is not pressed */
  }
}

const [toasts, device, events] = [new Box(), { onLine: true, languages: ["en"] }, new Map<string, (event: unknown) => void>()];
const texts = (): string[] => toasts.children.map((box) => box.children[0]?.textContent ?? "");
let page: typeof Toast;

beforeEach(async () => {
  vi.useFakeTimers();
  vi.resetModules();
  Object.assign(device, { onLine: true });
  toasts.children.splice(0);
  vi.stubGlobal("document", { documentElement: {}, getElementById: () => toasts, createElement: () => new Box() });
  vi.stubGlobal("navigator", device);
  vi.stubGlobal("addEventListener", (type: string, listener: (event: unknown) => void) => events.set(type, listener));
  page = await import("../../page/toast");
  page.bindNetwork();
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const ignoresRange = (file: string): Error =>
  new Error(
    `http://host/town/${file}.pmtiles: the server ignores range requests (HTTP 200, expected 206); use one that supports them, such as nginx, Apache or Caddy`,
  );

test("errors that differ by URL only are shown once, also after the toast has gone", () => {
  for (const file of ["0-45/color", "0-45/normal", "0-45/depth"]) page.report(ignoresRange(file));
  expect(texts()).toEqual([ignoresRange("0-45/color").message]);
  vi.advanceTimersByTime(60_000);
  page.report(ignoresRange("90-45/color"));
  expect(texts()).toEqual([]);
  page.report(new Error("http://host/town/rendering.json: HTTP 500"));
  expect(texts()).toHaveLength(1);
});

test("the page says once that it is offline, and says so again the next time", () => {
  Object.assign(device, { onLine: false });
  events.get("offline")?.({ type: "offline" });
  page.report(new Error("http://host/a: no response (Failed to fetch)"));
  vi.advanceTimersByTime(60_000);
  page.report(new Error("http://host/b: no response (Failed to fetch)"));
  expect(texts()).toEqual([]);
  Object.assign(device, { onLine: true });
  events.get("online")?.({ type: "online" });
  Object.assign(device, { onLine: false });
  events.get("offline")?.({ type: "offline" });
  expect(texts()).toEqual(["You’re offline. Showing saved areas only."]);
});

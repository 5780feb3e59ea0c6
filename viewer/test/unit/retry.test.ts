import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { FailedAttempt, isTransientStatus, retry } from "../../src/core/retry";

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

/** Returns when each attempt started, and how the last one ended. */
async function record(
  failures: readonly (FailedAttempt | null)[],
  options: Parameters<typeof retry>[1] = {},
): Promise<[starts_ms: number[], result: unknown]> {
  const starts: number[] = [];
  const begin = Date.now();
  const ended = retry((failed) => {
    starts.push(Date.now() - begin);
    return Promise.resolve(failures[failed] ?? "done");
  }, options).catch((reason: unknown) => reason);
  await vi.runAllTimersAsync();
  return [starts, await ended];
}

const BUSY = new Error("busy");
const busy = (retryAfter_ms?: number): FailedAttempt => new FailedAttempt(BUSY, true, retryAfter_ms);

test("waits double until an attempt succeeds", async () => {
  expect(await record([])).toEqual([[0], "done"]);
  expect(await record([busy(), busy(), busy()])).toEqual([[0, 250, 750, 1750], "done"]);
});

test("the last failure is thrown", async () => {
  expect(await record([busy(), busy(), busy(), busy()])).toEqual([[0, 250, 750, 1750], BUSY]);
  expect(await record([busy(), busy()], { attempts: 2, backoff_ms: 10 })).toEqual([[0, 10], BUSY]);
  expect(await record([new FailedAttempt(BUSY, false)])).toEqual([[0], BUSY]);
});

test("without a network there is one attempt", async () => {
  vi.stubGlobal("navigator", { onLine: false });
  expect(await record([busy(), busy()])).toEqual([[0], BUSY]);
  vi.unstubAllGlobals();
});

test("a server chooses the wait, up to 30 s", async () => {
  expect(await record([busy(0), busy(5000), busy(3_600_000)])).toEqual([[0, 0, 5000, 35_000], "done"]);
});

test("a wait ends with its signal", async () => {
  const controller = new AbortController();
  setTimeout(() => {
    controller.abort(new Error("left"));
  }, 100);
  const [starts, result] = await record([busy(), busy()], { signal: controller.signal });
  expect(starts).toEqual([0]);
  expect(String(result)).toBe("Error: left");
});

test.each([
  [200, false],
  [404, false],
  [429, true],
  [500, true],
  [501, false],
  [503, true],
])("status %i is transient: %s", (status, expected) => {
  expect(isTransientStatus(status)).toBe(expected);
});

import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import { renderTown } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { OUT, resting } from "./browser";

const bed = new TestBed({ town: renderTown(256, 0.76) }, { draws: false });
const DESK = { viewport: { width: 640, height: 400 } };
const directionOf = (page: Page): Promise<string> => page.evaluate(() => location.hash.slice(1).split("/")[0] ?? "");

async function open(options: object, hash = ""): Promise<{ page: Page; problems: string[] }> {
  const opened = await bed.openPage({ ...DESK, ...options }, { opening: true, maps: true });
  await opened.page.clock.install();
  await opened.page.goto(`${bed.server.origin}/?rendering=${bed.url("town")}${hash}`);
  await opened.page.waitForFunction(() => location.hash.length > 5);
  return opened;
}

/** Lets seconds pass in the page, and tiles arrive meanwhile. */
async function pass(page: Page, seconds: number): Promise<void> {
  for (let k = 0; k < seconds; k++) {
    await page.clock.runFor(1000);
    await page.waitForTimeout(50);
  }
}

test("the page opens with a slow turn, which ends at the first touch and is shown once in a session", async () => {
  const { page, problems } = await open({});
  const first = await directionOf(page);
  await expect
    .poll(
      async () => {
        await pass(page, 1);
        return directionOf(page);
      },
      { timeout: 30_000 },
    )
    .not.toBe(first);
  await page.screenshot({ path: `${OUT}/opening.png` });
  await page.mouse.move(320, 200);
  await page.mouse.down();
  await page.mouse.up();
  await pass(page, 3);
  const stopped = await directionOf(page);
  await pass(page, 6);
  expect(await directionOf(page)).toBe(stopped);
  await page.goto(`${bed.server.origin}/?rendering=${bed.url("town")}&again`);
  await page.waitForFunction(() => location.hash.length > 5);
  await pass(page, 6);
  expect(await directionOf(page)).toBe(first);
  expect(problems).toEqual([]);
});

test.each([
  ["with reduced motion", { reducedMotion: "reduce" }, ""],
  ["when the link has a view", {}, "#90-45/691000.0/5336000.0/500.0/1.00"],
] as const)("it does not turn %s", async (_, options, hash) => {
  const { page, problems } = await open(options, hash);
  const first = await directionOf(page);
  await resting(page);
  await pass(page, 7);
  expect(await directionOf(page)).toBe(first);
  expect(problems).toEqual([]);
});

test("depth loads after the first picture", async () => {
  const release = bed.server.hold("/normal/");
  bed.server.requests.length = 0;
  const depths = (): number => bed.server.requests.filter((url) => url.includes("/depth/")).length;
  const { page } = await open({ reducedMotion: "reduce" });
  try {
    await expect.poll(() => bed.server.requests.filter((url) => url.includes("/color/")).length, { timeout: 20_000 }).toBeGreaterThan(0);
    await pass(page, 3);
    expect(depths()).toBe(0);
  } finally {
    release();
  }
  await expect.poll(depths, { timeout: 20_000 }).toBeGreaterThan(0);
});

import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Orbit from "../../src/orbit";
import { renderTown } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { picture, settled, type Global } from "./page";

const bed = new TestBed({ town: renderTown() });
const undrawn = new TestBed(bed.server, { draws: false });
const VIEWPORT = { viewport: { width: 500, height: 420 } };
const FAILED = /Failed to load resource|net::ERR/;
type Turning = Global & { map3d: typeof Orbit; turns: string[] };

/** @param options those of the map; `dataSaver` fetches nothing ahead */
async function start(options: object, { orbit = false, from = bed } = {}): ReturnType<TestBed["start"]> {
  const opened = await from.start("town", { zoom: 3, direction: "0-45", dataSaver: true, ...options }, {}, VIEWPORT);
  if (orbit) {
    await opened.page.addScriptTag({ url: "/map3d-orbit.js" });
    await settled(opened.page, () => new (globalThis as Turning).map3d.orbit({ duration_ms: 200 }).addTo((globalThis as Global).map), null);
  }
  await opened.page.evaluate(() => {
    const g = globalThis as Turning;
    g.turns = [];
    g.map.on("directionchange", ({ direction }) => g.turns.push(direction));
  });
  return opened;
}

const turn = (page: Page, step = 1): Promise<void> =>
  page.evaluate((by) => {
    (globalThis as Global).map.rotate(by);
  }, step);
const turnsOf = (page: Page): Promise<string[]> => page.evaluate(() => (globalThis as Turning).turns);
const idle = (page: Page): Promise<void> =>
  page.evaluate(
    () =>
      new Promise<void>((done) => {
        (globalThis as Global).map.once("idle", () => {
          done();
        });
      }),
  );
/** Fraction of pixels that show something. */
const filled = (shot: Buffer): number => shot.filter((alpha, k) => k % 4 === 3 && alpha > 0).length / (shot.length / 4);

test.each([
  ["webgl", false],
  ["webgl", true],
  ["canvas", false],
  ["canvas", true],
] as const)(
  "with %s (orbit: %s) the picture stays until the other view covers the screen",
  async (drawer, orbit) => {
    const { page, problems } = await start({ drawer }, { orbit });
    const before = await picture(page);
    const release = bed.server.hold("/90-45/");
    try {
      await turn(page);
      for (let k = 0; k < 6; k++) {
        await page.waitForTimeout(80);
        expect((await picture(page)).equals(before)).toBe(true);
      }
      expect(await turnsOf(page)).toEqual([]);
      // Meanwhile, the map can be moved; the turn keeps what is at the centre then.
      await page.evaluate(() => {
        (globalThis as Global).map.panBy(10, 0);
      });
    } finally {
      release();
    }
    // No frame after the switch is emptier than a coarse picture of the other view.
    const fills: number[] = [];
    while (!(await turnsOf(page)).includes("90-45") || fills.length < 8) {
      const shot = await picture(page);
      if ((await turnsOf(page)).length > 0) fills.push(filled(shot));
    }
    await page.screenshot({ path: `${OUT}/turn-${drawer}-${String(orbit)}.png` });
    const end = await picture(page);
    expect(await page.evaluate(() => (globalThis as Global).map.direction)).toBe("90-45");
    expect(Math.min(...fills)).toBeGreaterThan(0.8 * Math.min(filled(before), filled(end)));
    expect(await page.evaluate("errors")).toEqual([]);
    expect(problems).toEqual([]);
  },
  60_000,
);

test("turns add up while they wait, and a turn back ends the wait", async () => {
  const { page } = await start({});
  const before = await picture(page);
  const release = [bed.server.hold("/90-45/"), bed.server.hold("/180-45/")];
  await turn(page);
  await turn(page);
  await turn(page, -1);
  await turn(page, -1);
  expect(await turnsOf(page)).toEqual([]);
  await turn(page, 2);
  for (const answer of release) answer();
  await page.waitForFunction(() => (globalThis as Global).map.direction === "180-45");
  expect(await turnsOf(page)).toEqual(["180-45"]);
  await page.evaluate(() => {
    (globalThis as Global).map.setDirection("0-45");
  });
  await idle(page);
  expect((await picture(page)).equals(before)).toBe(true);
});

test("a position set while a view waits shows that view at once", async () => {
  const { page } = await start({}, { from: undrawn });
  const release = bed.server.hold("/90-45/");
  try {
    expect(await page.evaluate(() => (globalThis as Global).map.setDirection("90-45").setView([691000, 5336000, 520], 3).direction)).toBe(
      "90-45",
    );
  } finally {
    release();
  }
});

test.each(["webgl", "canvas"])("offline, a turn that cannot be shown is refused, and said once (%s)", async (drawer) => {
  const { page } = await start({ drawer });
  const before = await picture(page);
  await page.context().setOffline(true);
  await turn(page);
  await expect
    .poll(() => page.evaluate<string[]>("errors"), { timeout: 20_000 })
    .toContainEqual(expect.stringMatching(/view "90-45" cannot be shown: its tiles are not available/));
  expect((await picture(page)).equals(before)).toBe(true);
  expect(await page.evaluate(() => (globalThis as Global).map.direction)).toBe("0-45");
  await page.context().setOffline(false);
  await page.evaluate(
    () =>
      new Promise<void>((done) => {
        (globalThis as Global).map
          .once("directionchange", () => {
            done();
          })
          .rotate(1);
      }),
  );
  await idle(page);
  expect(await page.evaluate(() => (globalThis as Global).map.direction)).toBe("90-45");
});

test.each(["webgl", "canvas"])(
  "at rest, coarse tiles of both neighbours are fetched, so that a turn needs no network (%s)",
  async (drawer) => {
    bed.server.requests.length = 0;
    const { page, problems } = await start({ drawer, dataSaver: false });
    const asked = (): string[] => bed.server.requests.filter((url) => /\/town\/(90|180|270)-45\//.test(url));
    await expect.poll(() => new Set(asked().map((url) => url.split("/")[3])), { timeout: 20_000 }).toEqual(new Set(["90-45", "270-45"]));
    await page.waitForTimeout(500);
    const fetched = asked();
    expect(fetched.every((url) => Number(url.split("/")[5]) <= 1)).toBe(true);
    expect(fetched.every((url) => /\/(color|normal)\//.test(url))).toBe(true);
    expect(fetched.length).toBeLessThanOrEqual(20);
    expect(new Set(fetched).size).toBe(fetched.length);
    await page.context().setOffline(true);
    await turn(page);
    await page.waitForFunction(() => (globalThis as Global).map.direction === "90-45");
    await page.waitForTimeout(600);
    await page.screenshot({ path: `${OUT}/turn-offline-${drawer}.png` });
    expect(filled(await picture(page))).toBeGreaterThan(0.2);
    expect(problems.filter((text) => !FAILED.test(text))).toEqual([]);
  },
);

test("a user who saves data gets nothing ahead", async () => {
  bed.server.requests.length = 0;
  const { page } = await start({}, { from: undrawn });
  await page.waitForTimeout(700);
  expect(bed.server.requests.filter((url) => /\/town\/(90|180|270)-45\//.test(url))).toEqual([]);
});

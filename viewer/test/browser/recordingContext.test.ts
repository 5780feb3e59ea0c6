import { expect, test } from "vitest";
import { renderTown } from "../fixture/rendering";
import { closePages, openPage } from "./browser";
import type { Recorded } from "./recordingContext";
import { picture, settled, type Global } from "./page";
import { TestBed } from "./testBed";

const bed = new TestBed({ town: renderTown() }, { draws: false });
type Recording = Global & { recorded: Recorded };

test("the shipped WebGL drawer runs on a recording context: tiles are uploaded once and drawn in each frame, and the canvas stays empty", async () => {
  const { page, problems } = await bed.start("town", { zoom: 3 });
  const recorded = (): Promise<Recorded> => page.evaluate(() => ({ ...(globalThis as unknown as Recording).recorded }));
  expect(await page.evaluate(() => (globalThis as Global).map.drawer)).toBe("webgl");
  const first = await recorded();
  const tiles = bed.server.requests.filter((url) => /\/town\/0-45\/(color|normal)\//.test(url)).length;
  expect(first.uploads).toBeGreaterThanOrEqual(tiles);
  expect(first.draws).toBeGreaterThan(4);
  await settled(page, () => (globalThis as Global).map.setLight({ azimuth_deg: 10 }), null);
  const second = await recorded();
  expect(second.uploads).toBe(first.uploads);
  expect(second.frames).toBeGreaterThan(first.frames);
  expect(second.draws).toBeGreaterThan(first.draws);
  expect((await picture(page)).some((byte) => byte > 0)).toBe(false);
  expect(problems).toEqual([]);
});

test("a context that is left open fails", async () => {
  const { page } = await openPage();
  await page.context().browser()?.newContext();
  await expect(closePages()).rejects.toThrow("the test left 1 contexts open");
});

import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Orbit from "../../src/orbit";
import { computeAxes } from "../../src/geo/axes";
import { makeFrame } from "../../src/geo/frame";
import { renderTown } from "../fixture/rendering";
import { ORIGIN, trace } from "../fixture/town";
import { TestBed } from "./testBed";
import { answered, OUT } from "./browser";
import { picture, settled, steady, type Global } from "./page";

const town = renderTown();
const bed = new TestBed({ town });
const [WIDE, HIGH] = [500, 420];
const VIEWPORT = { viewport: { width: WIDE, height: HIGH } };
type Orbiting = Global & { map3d: typeof Orbit; orbit: Orbit.orbit };

async function start(options: object = {}, duration_ms = 300): ReturnType<TestBed["start"]> {
  const opened = await bed.start("town", { zoom: 3, direction: "0-45", light: { lit: false }, ...options }, {}, VIEWPORT);
  await opened.page.addScriptTag({ url: "/map3d-orbit.js" });
  await settled(
    opened.page,
    (ms) => {
      const g = globalThis as Orbiting;
      g.orbit = new g.map3d.orbit({ duration_ms: ms }).addTo(g.map);
    },
    duration_ms,
  );
  return opened;
}

const twist = (page: Page, deg: number): Promise<void> =>
  page.evaluate((angle) => {
    (globalThis as Global).map.rotateBy((angle * Math.PI) / 180);
  }, deg);

/** Waits until the tiles of the other view have arrived, and the picture is still. */
async function still(page: Page): Promise<Buffer> {
  await answered(page);
  return steady(page, () => picture(page), 6);
}

/** Fraction of the pixels whose colour is that of a ray along the current direction, and fraction that show something. */
async function agreement(page: Page, shot: Buffer, lookAt: number): Promise<{ right: number; shown: number }> {
  const [corner, px] = await page.evaluate(
    (origin) => [(globalThis as Global).map.project(origin) as [number, number], (globalThis as Global).map.metresPerPixel] as const,
    ORIGIN,
  );
  const { json } = town;
  const frame = {
    ...makeFrame(json.views[0] as (typeof json.views)[0], json.size_m, json.tile_px, json.zmax),
    axes: computeAxes(lookAt, 45),
    d0: -2000,
  };
  let [right, shown, all] = [0, 0, 0];
  for (let y = 1; y < HIGH; y += 3) {
    for (let x = 1; x < WIDE; x += 3) {
      const hit = trace(frame, (x + 0.5 - corner[0]) * px, (corner[1] - y - 0.5) * px);
      const got = [...shot.subarray(4 * (WIDE * y + x), 4 * (WIDE * y + x) + 4)];
      if (!hit) continue;
      all++;
      if (got[3] === 255) shown++;
      if (hit.color.every((byte, k) => Math.abs(byte - (got[k] ?? 0)) <= 24)) right++;
    }
  }
  return { right: right / all, shown: shown / all };
}

test("a gesture between two views shows the picture of a ray caster; on release the map turns to the nearest view", async () => {
  const { page, problems } = await start();
  for (const deg of [20, 25]) {
    await twist(page, deg);
    await page.waitForFunction(() => (globalThis as Global).map.direction === "90-45");
    const at = deg === 20 ? 20 : 45;
    await expect.poll(async () => (await agreement(page, await still(page), at)).shown, { timeout: 60_000 }).toBeGreaterThan(0.985);
    await page.screenshot({ path: `${OUT}/orbit-${String(at)}.png` });
    expect((await agreement(page, await still(page), at)).right).toBeGreaterThan(0.9);
  }
  await twist(page, -20); // at 25 degrees: back is nearer
  await settled(
    page,
    () => {
      (globalThis as Global).map.endGesture();
    },
    null,
  );
  expect(await page.evaluate(() => (globalThis as Global).map.direction)).toBe("0-45");
  expect((await agreement(page, await picture(page), 0)).right).toBeGreaterThan(0.95);
  expect(problems).toEqual([]);
});

test("a transition ends in the picture of an immediate change; markers move along; with reduced motion it is immediate, without WebGL a cross-fade", async () => {
  const { page, problems } = await start({}, 2500);
  await page.evaluate((origin) => {
    const { map, map3d } = globalThis as Global;
    const path: number[] = [];
    Object.assign(globalThis, { path });
    map.on("move", () => path.push(map.project([origin[0] + 40, origin[1], origin[2]])?.[0] ?? NaN));
    new map3d.marker("here", [origin[0] + 40, origin[1], origin[2]]).addTo(map);
  }, ORIGIN);
  await settled(page, () => (globalThis as Global).map.setDirection("90-45"), null);
  const path = await page.evaluate(() => (globalThis as unknown as { path: number[] }).path);
  expect(new Set(path.map(Math.round)).size).toBeGreaterThanOrEqual(3);
  const turned = await picture(page);
  await page.emulateMedia({ reducedMotion: "reduce" });
  await settled(page, () => (globalThis as Global).map.setDirection("0-45"), null);
  const moves = await page.evaluate(async () => {
    const { map } = globalThis as Global;
    let count = 0;
    map.on("move", () => count++);
    await new Promise<void>((done) => {
      map.once("idle", () => {
        done();
      });
      map.setDirection("90-45");
    });
    return count;
  });
  expect(moves).toBe(1);
  expect(turned.equals(await picture(page))).toBe(true);
  expect(problems).toEqual([]);
  await page.context().close();

  const { page: flat, problems: none } = await start({ drawer: "canvas" });
  expect(
    await flat.evaluate(
      () =>
        new Promise((done) => {
          const { map } = globalThis as Global;
          map
            .once("directionchange", () => {
              done(map.container.querySelectorAll("canvas").length);
            })
            .setDirection("90-45");
        }),
    ),
  ).toBe(2);
  await flat.waitForFunction(() => document.querySelectorAll("canvas").length === 1);
  expect(none).toEqual([]);
});

import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { devices, type Page } from "playwright-core";
import type { Vec2, Vec3 } from "../../src/core/vec";
import { sub } from "../../src/core/vec";
import { uvdFromLocal } from "../../src/geo/axes";
import { screenFromLocal, type Camera } from "../../src/geo/camera";
import { computeDaylight } from "../../src/geo/daylight";
import { towardsLight } from "../../src/geo/light";
import type { DecodedPng } from "../../src/core/png";
import { renderLater } from "../fixture/secondEpoch";
import { renderTown, type Fixture } from "../fixture/rendering";
import { BOX, framesOf, ORIGIN, PLACE, THINGS, trace } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT, resting } from "./browser";
import { CountedActions, MAX_ACTIONS, throttle } from "./countedActions";
import { decoded } from "./page";

// Common tasks with a city model on a phone: each takes at most three actions after opening. MAP3D_CLOCK=1 takes a dense screen, slows the phone down and prints times.
const CLOCK = process.env.MAP3D_CLOCK === "1";
const [WIDTH, HEIGHT, DENSITY, PIXEL_M] = [390, 844, CLOCK ? 3 : 1, 0.38];
const PHONE = {
  viewport: { width: WIDTH, height: HEIGHT },
  deviceScaleFactor: DENSITY,
  isMobile: true,
  hasTouch: true,
  userAgent: devices["iPhone 14"].userAgent,
  timezoneId: "Europe/Berlin",
  locale: "en-GB",
};
const YEARS = new Map([
  [17, 1891],
  [1025, 1956],
  [2_000_000_001, 2012],
  [3_900_000_007, 1723],
]);

const drawn = new TestBed({ town: withYears(renderTown(256, PIXEL_M)), later: renderLater(256, PIXEL_M) });
const bed = new TestBed(drawn.server, { draws: CLOCK });
const views = framesOf(
  BOX,
  256,
  PIXEL_M,
  [0, 90, 180, 270].map((a) => [a, 45] as const),
).frames;

/** The same rendering, with a year for each object. */
function withYears(fixture: Fixture): Fixture {
  const text = (value: unknown): Uint8Array => new TextEncoder().encode(JSON.stringify(value));
  const list = JSON.parse(new TextDecoder().decode(fixture.files.get("objects/attributes.json"))) as { attributes: unknown[] };
  const [name, column] = ["yearOfConstruction", "0123456789abcdef"];
  list.attributes.push({ name, of: "attributes", column, type: "number", objects: YEARS.size, variety: YEARS.size, min: 1723, max: 2012 });
  fixture.files.set("objects/attributes.json", text(list));
  fixture.files.set(
    `objects/columns/${column}.json`,
    text({ map3d: "column", version: 1, name, of: "attributes", ids: [...YEARS.keys()], values: [...YEARS.values()] }),
  );
  return fixture;
}

interface Opened {
  readonly page: Page;
  readonly actions: CountedActions;
  readonly problems: string[];
  /** Time until the tools can be used, ms. */
  readonly opened: number;
}

/** Opens the page with the town and waits until it is idle. @param query further parameters, and the fragment of a shared link */
async function open(query = "", from = bed): Promise<Opened> {
  const { page, problems } = await from.openPage(PHONE, { maps: true });
  await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.addInitScript(() => {
    window.print = () => {
      document.title = "printed";
    };
  });
  if (CLOCK) await throttle(page);
  const begun = performance.now();
  await page.goto(`${bed.server.origin}/?rendering=${bed.url("town")}${query}`);
  await page.waitForFunction(() => location.hash.length > 5 && document.querySelector("#tools:not([hidden])"));
  const opened = performance.now() - begun;
  await resting(page);
  return { page, actions: new CountedActions(page), problems, opened };
}

async function end({ page, actions, problems, opened }: Opened, name: string): Promise<void> {
  const seconds = (ms: number): string => `${(ms / 1000).toFixed(1)} s`;
  if (CLOCK && actions.begun !== undefined)
    console.info(
      `${name}: opened in ${seconds(opened)}, ${String(actions.count)} actions in ${seconds(performance.now() - actions.begun)}`,
    );
  await page.screenshot({ path: `${OUT}/task-${name}.png` });
  expect(problems).toEqual([]);
  await page.context().close();
}

/** The view in the address. */
function cameraOf(page: Page): Camera {
  const [direction, x, y, z, zoom] = new URL(page.url()).hash.slice(1).split("/");
  const frame = views.find(({ id }) => id === direction);
  if (!frame) throw new Error(`no direction in ${page.url()}`);
  const [u, v] = uvdFromLocal(frame.axes, sub([Number(x), Number(y), Number(z)], ORIGIN));
  return { frame, u, v, zoom: Number(zoom), width: WIDTH, height: HEIGHT };
}

const placeOf = (page: Page, local: Vec3): Vec2 => screenFromLocal(cameraOf(page), local);
const offMiddle = ([x, y]: Vec2): number => Math.hypot(x - WIDTH / 2, y - HEIGHT / 2);
const number = (text: string): number => Number(/[\d,]+\.?\d*/.exec(text)?.[0].replaceAll(",", ""));
const measured = async (page: Page): Promise<string> => {
  await page.waitForSelector(".map3d-measure-main");
  return (await page.locator(".map3d-measure-main").textContent()) ?? "";
};

test("find an address", async () => {
  const opened = await open();
  const { page, actions } = opened;
  await actions.tap("#query");
  await actions.type("chapel");
  await actions.key("Enter");
  await page.waitForSelector("#info:not([hidden])");
  expect(await page.locator("#info h2").textContent()).toBe("Chapel");
  // In the middle of what the card leaves free.
  const card = await page.locator("#info").boundingBox();
  await expect
    .poll(
      () => {
        const [x, y] = placeOf(page, [-28, 47, 20]);
        return Math.hypot(x - WIDTH / 2, y - (card?.y ?? NaN) / 2);
      },
      { timeout: 20_000 },
    )
    .toBeLessThan(3);
  expect(new URL(page.url()).hash).toContain("/id=3900000007");
  await end(opened, "address");
});

test("the height of a roof above the ground", async () => {
  const opened = await open();
  const { page, actions } = opened;
  await actions.tap("#measure");
  await page.waitForSelector(".map3d-measure", { state: "attached" });
  await actions.tap(placeOf(page, [-45, -30, 0]));
  await page.waitForSelector(".map3d-measure circle", { state: "attached" });
  await actions.tap(placeOf(page, [-45, -4, 34]));
  const [, rise = ""] = (await measured(page)).split("↑");
  expect(Math.abs(number(rise) - 34)).toBeLessThan(PIXEL_M);
  await end(opened, "height");
});

test("the area of a facade", async () => {
  const opened = await open();
  const { page, actions } = opened;
  await actions.tap("#measure");
  await page.waitForSelector(".map3d-measure", { state: "attached" });
  await actions.tap("#measure-area");
  await actions.tap(placeOf(page, [31, -46, 8]));
  const text = await measured(page);
  expect(Math.abs(number(text) / (54 * 16) - 1)).toBeLessThan(0.02);
  expect(text).toMatch(/∠ 90°$/);
  await end(opened, "area");
});

test("turn to the back of a building", async () => {
  const opened = await open();
  const { page, actions } = opened;
  expect(cameraOf(page).frame.id).toBe("0-45");
  await actions.tap(placeOf(page, [-45, -4, 34]));
  await page.waitForSelector("#info:not([hidden])");
  await actions.tap("#info .behind");
  await page.waitForFunction(() => location.hash.startsWith("#180-45/"));
  await expect.poll(() => offMiddle(placeOf(page, [-45, -4, 17])), { timeout: 20_000 }).toBeLessThan(3);
  expect(await page.locator("#info h2").textContent()).toBe("Town hall");
  // The centre shows its north wall, seen from the north.
  const { frame, u, v } = cameraOf(page);
  expect(trace(frame, u, v)?.id).toBe(17);
  await page.locator("#info .close").tap();
  await page.touchscreen.tap(WIDTH / 2, HEIGHT / 2);
  await page.waitForSelector("#info:not([hidden])");
  expect(await page.locator("#info h2").textContent()).toBe("Town hall");
  await end(opened, "behind");
});

test("share a view", async () => {
  const opened = await open();
  const { page, actions } = opened;
  await actions.tap(placeOf(page, [32, 26, 62]));
  await page.waitForSelector("#info:not([hidden])");
  await resting(page);
  await actions.tap("#share");
  await page.waitForSelector("dialog[open] .share-qr");
  await page.screenshot({ path: `${OUT}/task-share-dialog.png` });
  await actions.tap("#share-link-copy");
  await page.locator("#share-link-copy", { hasText: "Copied" }).waitFor();
  expect(await page.inputValue("#share-embed")).toContain(`<iframe src="${page.url().replaceAll("&", "&amp;")}"`);
  const link = await page.evaluate(() => navigator.clipboard.readText());
  expect(link).toBe(page.url());
  const { page: other } = await bed.openPage(PHONE, { maps: true });
  await other.goto(link);
  await other.waitForSelector("#info:not([hidden])");
  await resting(other);
  expect(await other.locator("#info h2").textContent()).toBe("Tower");
  const [a, b] = [cameraOf(page), cameraOf(other)];
  expect([b.frame.id, b.zoom, b.u, b.v]).toEqual([a.frame.id, a.zoom, a.u, a.v]);
  await other.context().close();
  await end(opened, "share");
});

test("compare two epochs", async () => {
  const opened = await open("&with=later");
  const { page, actions } = opened;
  const slider = page.locator("#epochs input");
  await slider.waitFor();
  expect(await slider.getAttribute("aria-valuetext")).toBe("A small town");
  await page.screenshot({ path: `${OUT}/task-epochs-before.png` });
  const { x, y, width, height } = (await slider.boundingBox()) as { x: number; y: number; width: number; height: number };
  await actions.drag([x + 10, y + height / 2], [x + width - 4, y + height / 2]);
  await page.waitForFunction(() => location.hash.includes("/epoch=1"));
  expect(await slider.getAttribute("aria-valuetext")).toBe("Ten years later");
  await resting(page);
  // The tower is gone, and a new school can be selected.
  await actions.tap(placeOf(page, [-10, -20, 24]));
  await page.waitForSelector("#info:not([hidden])");
  expect(await page.locator("#info h2").textContent()).toBe("New school");
  await actions.tap(placeOf(page, [32, 26, 62]));
  await page.waitForFunction(
    () => document.querySelector("#info h2")?.textContent !== "New school" || document.querySelector("#info[hidden]"),
  );
  expect(await page.locator("#info h2").textContent()).not.toBe("Tower");
  // The link shows the same epoch.
  const { page: other } = await bed.openPage(PHONE);
  await other.goto(page.url());
  await other.waitForSelector("#epochs input");
  expect(await other.locator("#epochs input").getAttribute("aria-valuetext")).toBe("Ten years later");
  await other.context().close();
  await end(opened, "epochs");
});

test("compare four directions", async () => {
  const opened = await open();
  const { page, actions } = opened;
  const { zoom } = cameraOf(page);
  const windows = (): Promise<number> => page.locator(".map3d").count();
  await actions.tap("#compare");
  await expect
    .poll(() => page.locator(".map3d-facing").allTextContents(), { timeout: 20_000 })
    .toEqual(["Facing north", "Facing east", "Facing south", "Facing west"]);
  await resting(page);
  await page.screenshot({ path: `${OUT}/task-four.png` });
  expect(await windows()).toBe(4);
  // The four quarters differ, and nothing covers their captions.
  for (const caption of await page.locator(".map3d-facing").all()) {
    const { x, y, width, height } = (await caption.boundingBox()) as { x: number; y: number; width: number; height: number };
    expect(
      await page.evaluate(([cx, cy]) => document.elementsFromPoint(cx, cy).some((node) => node.matches(".card, .end-compare")), [
        x + width / 2,
        y + height / 2,
      ] as const),
    ).toBe(false);
  }
  // A tap in one of the maps selects; the others highlight the same object.
  await actions.tap([WIDTH * 0.75, HEIGHT * 0.27]);
  await page.waitForSelector("#info:not([hidden])");
  await page.screenshot({ path: `${OUT}/task-four-selected.png` });
  await page.locator("#info .close").tap();
  await actions.tap("#end-compare");
  expect([await windows(), await page.locator(".map3d-facing").count()]).toEqual([1, 0]);
  await expect.poll(() => cameraOf(page).zoom, { timeout: 20_000 }).toBeCloseTo(zoom, 2);
  await end(opened, "four-closed");
});

test("a missing epoch shows a message, and the page works without it", async () => {
  const { page } = await open("&with=nowhere");
  await page.waitForSelector(".toast");
  expect(await page.locator(".toast p").textContent()).toContain("404");
  expect(await page.locator("#epochs").isHidden()).toBe(true);
  await page.touchscreen.tap(...placeOf(page, [-45, -4, 34]));
  await page.waitForSelector("#info:not([hidden])");
});

test("read an attribute", async () => {
  const opened = await open();
  const { page, actions } = opened;
  await actions.tap(placeOf(page, [-45, -4, 34]));
  await page.waitForSelector("#info:not([hidden])");
  const rows = (number: number): Promise<Record<string, string | null | undefined>> =>
    page
      .locator("#info dl")
      .nth(number)
      .evaluate((list) =>
        Object.fromEntries([...list.querySelectorAll("dt")].map((name) => [name.textContent, name.nextElementSibling?.textContent])),
      );
  expect(await rows(0)).toMatchObject({ Height: "34 m" });
  await actions.tap("#info summary");
  expect(await rows(1)).toMatchObject({ measuredHeight: "34", roofType: "3100", listed: "Yes" });
  await page.locator("#info dd").last().scrollIntoViewIfNeeded();
  expect(await page.locator("#info dd").last().isVisible()).toBe(true);
  await end(opened, "attribute");
});

test("colour by year", async () => {
  const opened = await open("", drawn);
  const { page, actions } = opened;
  await actions.tap("#more");
  await actions.choose("#color-by", "yearOfConstruction");
  await page.waitForSelector("#legend button");
  await resting(page);
  const classes = await page.locator("#legend button").evaluateAll((buttons) =>
    buttons.map((button) => {
      const swatch =
        [...button.querySelectorAll("*"), button]
          .map((part) => getComputedStyle(part).backgroundColor)
          .find((color) => color !== "rgba(0, 0, 0, 0)") ?? "";
      return { label: button.textContent, rgb: (swatch.match(/\d+/g) ?? []).slice(0, 3).map(Number) };
    }),
  );
  expect(classes.map(({ label }) => label)).toEqual([...YEARS.values()].sort((a, b) => a - b).map(String));
  const shot = await decoded(await page.screenshot({ path: `${OUT}/task-colors.png` }));
  // Each roof has the colour of its year, apart from lighting.
  for (const {
    id,
    box: [lo, hi],
  } of THINGS.slice(1)) {
    const seen = pixel(shot, placeOf(page, [(lo[0] + hi[0]) / 2, (lo[1] + hi[1]) / 2, hi[2]]));
    const like = (rgb: readonly number[]): number => Math.hypot(...unit(rgb).map((part, k) => part - (unit(seen)[k] ?? 0)));
    const nearest = [...classes].sort((a, b) => like(a.rgb) - like(b.rgb))[0];
    expect(nearest?.label).toBe(String(YEARS.get(id)));
  }
  expect(page.url()).toContain("by=yearOfConstruction");
  await end(opened, "year");
});

test("see the shadow at 17:00", async () => {
  const start = "#0-45/691000.0/5336000.0/500.0/1.30/t=2026-06-21T10:00Z";
  const opened = await open(start, drawn);
  const { page, actions } = opened;
  const slider = page.locator("#time");
  expect(await page.locator("#clock").textContent()).toBe("12:00");
  const { x, y, width, height } = (await slider.boundingBox()) as { x: number; y: number; width: number; height: number };
  const THUMB_PX = 22;
  const [dawn, dusk] = await slider.evaluate(
    (input) => [Number((input as HTMLInputElement).min), Number((input as HTMLInputElement).max)] as const,
  );
  const at = (hour: number): Vec2 => [x + THUMB_PX / 2 + ((width - THUMB_PX) * (hour - dawn)) / (dusk - dawn), y + height / 2];
  await actions.drag(at(12), at(17));
  expect(await page.locator("#clock").textContent()).toBe("17:00");
  await page.waitForFunction(() => location.hash.includes("/t=2026-06-21T15:00Z"));
  const light = towardsLight(computeDaylight(new Date("2026-06-21T15:00:00Z"), PLACE));
  const places = { lit: [] as Vec2[], dark: [] as Vec2[] };
  for (let k = 0; k < 4000; k++) {
    const ground: Vec3 = [-95 + ((k * 37.7) % 190), -75 + ((k * 61.3) % 150), 0];
    const [u, v, d] = uvdFromLocal(cameraOf(page).frame.axes, ground);
    const hit = trace(cameraOf(page).frame, u, v);
    // Visible ground, away from edges and paths.
    if (
      hit?.id !== 3 ||
      Math.abs(cameraOf(page).frame.d0 + hit.d - d) > 0.01 ||
      Math.abs(ground[0] + 8) < 6 ||
      Math.abs(ground[1] - 26) < 5
    )
      continue;
    const around = [
      [0, 0],
      [2, 0],
      [-2, 0],
      [0, 2],
      [0, -2],
    ].map(([dx = 0, dy = 0]) => shaded([ground[0] + dx, ground[1] + dy, 0], light));
    const [px, py] = placeOf(page, ground);
    if (around.some((dark) => dark !== around[0]) || px < 5 || px > 300 || py < 200 || py > 640) continue;
    (around[0] ? places.dark : places.lit).push([px, py]);
  }
  expect(places.dark.length).toBeGreaterThan(20);
  expect(places.lit.length).toBeGreaterThan(200);
  // Fraction of the positions in shadow, according to rays, that is darker than sunlit ground.
  await expect
    .poll(
      async () => {
        const shot = await decoded(await page.screenshot());
        const values = (of: readonly Vec2[]): number[] => of.map((place) => pixel(shot, place).reduce((sum, part) => sum + part, 0));
        const bright = values(places.lit).sort((a, b) => a - b)[Math.floor(places.lit.length / 2)] ?? 0;
        return values(places.dark).filter((value) => value < 0.85 * bright).length / places.dark.length;
      },
      { timeout: 20_000, interval: 500 },
    )
    .toBeGreaterThan(0.8);
  await end(opened, "shadow");
});

test("print, and save a picture", async () => {
  const opened = await open();
  const { page, actions } = opened;
  await actions.tap("#make-picture");
  await page.screenshot({ path: `${OUT}/task-picture.png` });
  await actions.tap("#picture-print");
  await page.waitForFunction(() => document.title === "printed");
  const [width, height] = await page
    .locator("#sheet img")
    .evaluate((image) => [(image as HTMLImageElement).naturalWidth, (image as HTMLImageElement).naturalHeight]);
  expect([width, height]).toEqual([WIDTH, HEIGHT]);
  expect(await page.locator("#sheet h1").textContent()).toBe("A small town");
  await end(opened, "print");
  const again = await open("", drawn);
  await again.actions.tap("#make-picture");
  const download = again.page.waitForEvent("download");
  await again.actions.tap("#picture-save");
  const saved = await decoded(readFileSync(await (await download).path()));
  expect([saved.width, saved.height]).toEqual([WIDTH, HEIGHT]);
  const places = Array.from({ length: 400 }, (_, k) => Math.floor((k * WIDTH * HEIGHT) / 400) * saved.channels);
  expect(new Set(places.map((at) => saved.data.subarray(at, at + 3).join(" "))).size).toBeGreaterThan(10);
  await end(again, "save");
});

test("a fourth action fails", async () => {
  const opened = await open();
  for (let k = 0; k < MAX_ACTIONS; k++) await opened.actions.key("Tab");
  expect(() => opened.actions.key("Tab")).toThrow("4 actions");
  await end(opened, "fourth");
});

/** Is a box between a position and the light? */
function shaded(from: Vec3, light: Vec3): boolean {
  return THINGS.slice(1).some(({ box: [lo, hi] }) => {
    let [near, far] = [0.01, Infinity];
    for (const k of [0, 1, 2] as const) {
      const [a, b] = [(lo[k] - from[k]) / light[k], (hi[k] - from[k]) / light[k]];
      [near, far] = [Math.max(near, Math.min(a, b)), Math.min(far, Math.max(a, b))];
    }
    return near < far;
  });
}

function pixel({ width, channels, data }: DecodedPng, [x, y]: Vec2): number[] {
  const at = channels * (Math.round(y * DENSITY) * width + Math.round(x * DENSITY));
  return [...data.subarray(at, at + 3)];
}

const unit = (rgb: readonly number[]): number[] => rgb.map((part) => part / Math.max(Math.hypot(...rgb), 1));

import { expect, test } from "vitest";
import { devices, type BrowserContextOptions, type Page } from "playwright-core";
import type * as Offline from "../../src/offline";
import { withDataTiles } from "../fixture/encodeDataTile";
import { published } from "../fixture/folder";
import { renderTown } from "../fixture/rendering";
import { rows } from "./rows";
import { TestBed } from "./testBed";
import { OUT, resting } from "./browser";
import { pixels, steady, type Global } from "./page";

const town = renderTown(128, 0.38);
const bed = new TestBed({ town, published: published(town), packed: withDataTiles(town, "packed") });
const CSP = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src *; worker-src 'self' blob:";
for (const path of ["/", "/bare"]) bed.server.policies.set(path, CSP);

type Kept = Global & { map3d: typeof Offline };
const TOWER = [691032, 5336026, 562] as const;
const VIEW = { zoom: 3, center: TOWER, preserveDrawingBuffer: true, language: "en" };
const FAILED = /Failed to load resource|net::ERR/;

/** The bare page with a map, at rest. */
async function start(page: Page, rendering: string): Promise<void> {
  page.setDefaultTimeout(20_000);
  await page.goto(`${bed.server.origin}/bare`);
  await page.addScriptTag({ url: "/map3d-offline.js" });
  await page.evaluate(
    ([url, options]) =>
      new Promise<void>((done) => {
        const g = globalThis as Global;
        g.map = new g.map3d.map("mapcanvas", options);
        g.layer = new g.map3d.imageLayer(url).addTo(g.map);
        g.errors = [];
        g.map.on("error", ({ error }) => g.errors.push(error.message));
        g.map.once("idle", () => {
          done();
        });
      }),
    [bed.url(rendering), VIEW] as const,
  );
}

/** Downloads the visible area; on request, stops after some tiles. */
const download = (
  page: Page,
  stopAfter = Infinity,
): Promise<{ area?: Offline.StoredArea; why?: string; progress: Offline.AreaProgress[] }> =>
  page.evaluate(async (most) => {
    const g = globalThis as unknown as Kept;
    const [ending, progress] = [new AbortController(), [] as Offline.AreaProgress[]];
    try {
      await g.map3d.registerWorker("/map3d-worker.js");
      const area = await g.map3d.downloadArea(g.map, {
        name: "tower",
        signal: ending.signal,
        files: ["/bare", "/bare.css", "/map3d.js", "/map3d-offline.js"],
        onProgress: (now) => {
          progress.push(now);
          if (now.done === most) ending.abort(new Error("stopped"));
        },
      });
      return { area, progress };
    } catch (reason) {
      return { why: String(reason), progress };
    }
  }, stopAfter);

async function offline(page: Page, act: () => Promise<void>): Promise<void> {
  const port = Number(new URL(bed.server.origin).port);
  await page.context().setOffline(true);
  await bed.server.close();
  try {
    await act();
  } finally {
    await bed.server.listen(port);
    await page.context().setOffline(false);
  }
}

const tilesAsked = (): string[] => bed.server.requests.filter((url) => /\/tiles\/\w+\/\d/.test(url));

test.each(["town", "published", "packed"])("an area of %s can be interrupted, resumed, opened offline and deleted", async (rendering) => {
  const { page, problems } = await bed.openPage({ viewport: { width: 240, height: 180 } });
  await start(page, rendering);
  const wanted = await pixels(page);
  const estimate = await page.evaluate(() => (globalThis as unknown as Kept).map3d.estimateArea((globalThis as Global).map));

  const stopped = await download(page, 12);
  expect(stopped.why).toBe("Error: stopped");
  expect(stopped.progress.length).toBeGreaterThanOrEqual(12);
  const list = (): Promise<Offline.StoredArea[]> => page.evaluate(() => (globalThis as unknown as Kept).map3d.listAreas());
  expect(await list()).toMatchObject([{ name: "tower", complete: false, title: "A small town" }]);
  const had = await page.evaluate(async () => (await (await caches.open("map3d-area:tower")).keys()).map(({ url }) => url));
  expect(had.filter((url) => /rendering\.json|bare/.test(url))).toEqual([]);

  bed.server.requests.length = 0;
  const { area, progress } = await download(page);
  expect(area).toMatchObject({
    name: "tower",
    complete: true,
    tiles: estimate.tiles,
    directions: ["0-45", "90-45", "180-45", "270-45"],
    layers: rendering === "packed" ? ["color", "data"] : ["color", "normal", "id", "depth"],
  });
  expect(progress.at(-1)).toMatchObject({ done: estimate.tiles, total: estimate.tiles });
  const archives = rendering === "published" ? 16 * 16384 : 0; // their first reads, which outweigh tiles as small as these
  expect(Math.abs(((progress.at(-1)?.bytes ?? 0) - archives) / estimate.bytes - 1)).toBeLessThan(0.4);
  const again = tilesAsked().filter((url) => had.some((key) => key.endsWith(url)));
  expect(again).toEqual([]);
  expect(tilesAsked().length).toBeGreaterThan(20);
  expect(await list()).toEqual([area]);

  await offline(page, async () => {
    await start(page, rendering);
    expect((await pixels(page)).equals(wanted)).toBe(true);
    const found = await page.evaluate(async (tower) => {
      const { map, layer, errors } = globalThis as Global;
      const { id, approximate } = await map.pick(map.project([...tower]) ?? [0, 0]);
      const column = (await layer.attributes()).find(({ name }) => name === "measuredHeight");
      return {
        id,
        approximate,
        name: (await layer.object(id))?.name,
        search: (await layer.search("TOW")).length,
        heights: column && (await layer.column(column)).size,
        errors,
      };
    }, TOWER);
    expect(found).toEqual({ id: 2_000_000_001, approximate: false, name: "Tower", search: 2, heights: 5, errors: [] });
    for (const direction of ["180-45", "90-45"]) {
      await page.evaluate(
        (to) =>
          new Promise<void>((done) => {
            (globalThis as Global).map
              .once("idle", () => {
                done();
              })
              .setDirection(to);
          }),
        direction,
      );
      expect(await page.evaluate("errors")).toEqual([]);
    }
    await page.evaluate(() => {
      (globalThis as Global).map.setDirection("0-45").setView([690910, 5335925, 500], 3.5);
    });
    await expect.poll(() => page.evaluate<string[]>("errors"), { timeout: 20_000 }).not.toEqual([]);
    expect((await page.evaluate<string[]>("errors"))[0]).toMatch(/no response/);
    await page.evaluate(
      (tower) =>
        new Promise<void>((done) => {
          (globalThis as Global).map
            .once("idle", () => {
              done();
            })
            .setView([...tower], 3);
        }),
      TOWER,
    );
    expect((await pixels(page)).equals(wanted)).toBe(true);
  });

  expect(await page.evaluate(() => (globalThis as unknown as Kept).map3d.removeArea("tower"))).toBe(true);
  expect(await page.evaluate(() => (globalThis as unknown as Kept).map3d.removeArea("tower"))).toBe(false);
  expect([await list(), await page.evaluate(() => caches.keys())]).toEqual([[], []]);
  expect(problems.filter((text) => !FAILED.test(text))).toEqual([]);
});

test("a changed rendering is shown in its new state online, and the saved area is updated", async () => {
  const fixture = bed.server.renderings.get("published");
  if (!fixture) throw new Error("there is a published town");
  const { page } = await bed.openPage();
  await start(page, "published");
  const before = await download(page);
  const view = town.json.views[1]?.id ?? "";
  const files = new Map(
    [...fixture.files].map(([path, bytes]) => [
      path,
      path.startsWith("0-45/") ? (fixture.files.get(path.replace("0-45", view)) ?? bytes) : bytes,
    ]),
  );
  bed.server.renderings.set("published", { ...fixture, json: { ...fixture.json, content_version: 8 }, files });
  await start(page, "published");
  const after = await pixels(page);
  expect(await page.evaluate("errors")).toEqual([]);
  const updated = await download(page);
  expect(updated.area?.complete).toBe(true);
  expect(updated.area?.stored).not.toBe(before.area?.stored);
  await offline(page, async () => {
    await start(page, "published");
    expect((await pixels(page)).equals(after)).toBe(true);
  });
  bed.server.renderings.set("published", fixture);
});

test("full storage, a missing worker and an unreachable host are errors", async () => {
  const { page } = await bed.openPage();
  await start(page, "town");
  const failed = (act: string): Promise<string> =>
    page.evaluate(
      `(async () => { try { return String(JSON.stringify(await (${act}))); } catch (error) { return error.name + ": " + error.message; } })()`,
    );
  await page.evaluate(() => {
    const put = Object.getOwnPropertyDescriptor(Cache.prototype, "put") as PropertyDescriptor;
    const full = (key: string): Promise<void> =>
      key.includes("/depth/") ? Promise.reject(new DOMException("no room", "QuotaExceededError")) : Promise.resolve();
    Object.assign(globalThis, {
      full: () => Object.defineProperty(Cache.prototype, "put", { ...put, value: full }),
      roomy: () => Object.defineProperty(Cache.prototype, "put", put),
    });
  });
  expect(await failed("(full(), map3d.downloadArea(map, { files: [] }))")).toMatch(
    /^StorageError: storage is full: could not save http.*\/depth\/.*\(QuotaExceededError\); save a smaller area/,
  );
  await page.evaluate("void roomy()");
  expect(
    await failed("(navigator.storage.estimate = async () => ({ quota: 1000, usage: 990 }), map3d.downloadArea(map, { files: [] }))"),
  ).toMatch(/^StorageError: not enough storage: the area needs about [\d.]+ MB, 0\.0 MB are available/);
  await page.evaluate("delete navigator.storage.estimate");
  expect(await failed('map3d.registerWorker("/nowhere/map3d-worker.js")')).toMatch(
    /^StorageError: cannot register \/nowhere\/map3d-worker\.js/,
  );
  expect(await failed('map3d.downloadArea(map, { files: ["/nowhere.css"] })')).toMatch(/^FetchError: .*\/nowhere\.css: HTTP 404/);
  expect(await failed("map3d.listAreas().then((areas) => areas.every(({ complete }) => !complete))")).toBe("true");
  bed.server.failures.set("/90-45/normal/", 3);
  expect(await failed("map3d.downloadArea(map, { files: [] }).then(({ complete }) => complete)")).toBe("true");
});

const PHONE = {
  viewport: { width: 390, height: 844 },
  deviceScaleFactor: 2,
  isMobile: true,
  hasTouch: true,
  userAgent: devices["iPhone 14"].userAgent,
};
const PAGES = rows<[string, BrowserContextOptions]>(
  [["phone", { ...PHONE, locale: "de-DE" }]],
  [
    ["desk", { viewport: { width: 1280, height: 800 } }],
    ["dark", { ...PHONE, colorScheme: "dark", locale: "fr-FR" }],
  ],
);

test.each(PAGES)("the page saves itself and the view for offline use: %s", async (name, options) => {
  const { page, problems } = await bed.openPage(options, { maps: true });
  page.setDefaultTimeout(30_000);
  const open = async (): Promise<Buffer> => {
    await page.goto(`${bed.server.origin}/?rendering=${bed.url("town")}`);
    await resting(page);
    const { width = 0, height = 0 } = options.viewport ?? {};
    // The map without its controls.
    return steady(page, () => page.screenshot({ clip: { x: width / 2 - 180, y: height / 2 - 160, width: 360, height: 300 } }));
  };
  const before = await open();
  expect(await page.evaluate(async () => [await caches.keys(), (await navigator.serviceWorker.getRegistrations()).length])).toEqual([
    [],
    0,
  ]);
  await page.locator("#save-offline").click();
  await page.locator("#offline-save:enabled").waitFor();
  await page.screenshot({ path: `${OUT}/offline-${name}.png` });
  expect(await page.locator("#offline-note").innerText()).toMatch(/^≈ [\d.,]+.?(MB|Mo) · .*(available|verfügbar|disponibles)$/);
  await page.route(/\/tiles\/.*\/normal\//, async (route) => {
    await new Promise((done) => setTimeout(done, 60));
    await route.continue();
  });
  await page.locator("#offline-save").click();
  await page.waitForFunction(() => (document.getElementById("offline-progress") as HTMLProgressElement).value > 0.4);
  await page.screenshot({ path: `${OUT}/offline-${name}-working.png` });
  await page.unroute(/\/tiles\/.*\/normal\//);
  await page.locator(".toast").waitFor();
  await offline(page, async () => {
    expect((await open()).equals(before)).toBe(true);
    await page.fill("#query", "Tower");
    await page.waitForSelector("#results li");
    await page.keyboard.press("Enter");
    await page.waitForSelector("#info:not([hidden])");
    expect(await page.locator("#info h2").textContent()).toBe("Tower");
    await resting(page);
    await page.screenshot({ path: `${OUT}/offline-${name}-without.png` });
  });
  await page.locator("#info .close").click();
  await page.locator("#save-offline").click();
  await page.locator("#offline-areas button").waitFor();
  await page.locator("#offline-save:enabled").waitFor();
  await page.screenshot({ path: `${OUT}/offline-${name}-kept.png` });
  await page.locator("#offline-areas button").click();
  await page.waitForFunction(() => document.querySelector("#offline-areas li") === null);
  expect(await page.evaluate(() => caches.keys())).toEqual([]);
  expect(problems.filter((text) => !FAILED.test(text))).toEqual([]);
});

import { renameSync, rmSync, unlinkSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { afterAll, expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Files from "../../src/files";
import { published, writeFolder } from "../fixture/folder";
import { renderTown } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { animationsEnd, pixels, type Global } from "./page";

const town = renderTown(128, 0.38);
const bed = new TestBed({ town });
const undrawn = new TestBed(bed.server, { draws: false });
const FOLDERS = { loose: writeFolder(town, "town"), archives: writeFolder(published(town), "town") };
afterAll(() => {
  for (const folder of Object.values(FOLDERS)) rmSync(dirname(folder), { recursive: true });
});

type Dropping = Global & { map3d: typeof Files; tool: Files.dropFiles; dropped: string[] };

/** An empty map that accepts files. */
async function start(options: { language?: string } = {}, context: object = {}, from = bed): Promise<{ page: Page; problems: string[] }> {
  const opened = await from.bare(context);
  opened.page.setDefaultTimeout(20_000);
  await opened.page.addScriptTag({ url: "/map3d-files.js" });
  await opened.page.evaluate((given: { language?: string }) => {
    const g = globalThis as unknown as Dropping;
    g.map = new (g as unknown as Global).map3d.map("mapcanvas", { preserveDrawingBuffer: true, language: given.language ?? "en" });
    [g.errors, g.dropped] = [[], []];
    g.map.on("error", ({ error }) => g.errors.push(error.message));
    g.tool = new g.map3d.dropFiles(given).addTo(g.map);
    g.tool
      .on("dropped", ({ layer }) => g.dropped.push(layer.rendering?.json.name ?? ""))
      .on("error", ({ error }) => g.errors.push(error.message));
  }, options);
  return opened;
}

/** Waits for the drop, and until the map rests. */
const rested = (page: Page, count = 1): Promise<unknown> =>
  page.evaluate(
    (n) =>
      new Promise<void>((done) => {
        const g = globalThis as unknown as Dropping;
        const idle = (): void => {
          g.map.once("idle", () => {
            done();
          });
        };
        if (g.dropped.length >= n) idle();
        else
          g.tool.on("dropped", () => {
            if (g.dropped.length >= n) idle();
          });
      }),
    count,
  );

/** Drags real files from this machine. */
async function drag(page: Page, paths: readonly string[], until: "over" | "dropped"): Promise<void> {
  const session = await page.context().newCDPSession(page);
  const data = { items: [], files: [...paths], dragOperationsMask: 1 };
  const send = (type: "dragEnter" | "dragOver" | "drop"): Promise<unknown> =>
    session.send("Input.dispatchDragEvent", { type, x: 300, y: 300, data });
  await send("dragEnter");
  await send("dragOver");
  if (until === "dropped") await send("drop");
}

const said = (page: Page): Promise<string> => page.locator(".map3d-status").innerText();
const STATE = "[map.zoom, map.direction, map.layers.length, dropped, errors]";

/** Takes a picture of the same view over HTTP. */
async function overHttp(): Promise<Buffer> {
  const { page } = await bed.start("town", { language: "en" });
  await page.evaluate(
    () =>
      new Promise<void>((done) => {
        const { map, layer } = globalThis as Global;
        const {
          origin,
          box: [low, high],
        } = layer.rendering?.json ?? {
          origin: [0, 0, 0],
          box: [
            [0, 0, 0],
            [0, 0, 0],
          ],
        };
        map
          .once("idle", () => {
            done();
          })
          .fitBounds([
            [origin[0] + low[0], origin[1] + low[1], origin[2] + low[2]],
            [origin[0] + high[0], origin[1] + high[1], origin[2] + high[2]],
          ]);
      }),
  );
  const shown = await pixels(page);
  await page.context().close();
  return shown;
}

test.each(["loose", "archives"] as const)(
  "a dropped or chosen folder (%s) shows the same pixels, picks and attributes as over HTTP",
  async (kind) => {
    const wanted = await overHttp();
    bed.server.requests.length = 0;
    const { page, problems } = await start();
    await drag(page, [FOLDERS[kind]], "dropped");
    await rested(page);
    expect((await pixels(page)).equals(wanted)).toBe(true);
    expect(await page.evaluate(STATE)).toEqual([expect.any(Number), "0-45", 1, ["town"], []]);
    const found = await page.evaluate(async () => {
      const { map } = globalThis as Global;
      const { id, layer, approximate } = await map.pick(map.project([691032, 5336026, 562]) ?? [0, 0]);
      return { id, approximate, object: (await layer?.object(id))?.name };
    });
    expect(found).toEqual({ id: 2_000_000_001, approximate: false, object: "Tower" });
    await page.screenshot({ path: `${OUT}/files-${kind}.png` });

    const chooser = page.waitForEvent("filechooser");
    await page.getByRole("button", { name: "Open map folder" }).press("Enter");
    await (await chooser).setFiles(FOLDERS[kind]);
    await rested(page, 2);
    expect((await pixels(page)).equals(wanted)).toBe(true);
    expect(await page.evaluate(STATE)).toEqual([expect.any(Number), "0-45", 1, ["town", "town"], []]);
    expect(bed.server.requests.filter((url) => !/^\/(bare|map3d)/.test(url))).toEqual([]);
    expect(problems).toEqual([]);
  },
);

test("the files of a folder can be dropped, and so can a parent folder", async () => {
  const { page } = await start();
  const pieces = ["rendering.json", "objects", "0-45", "90-45", "180-45", "270-45"].map((name) => join(FOLDERS.archives, name));
  await drag(page, pieces, "dropped");
  await rested(page);
  const shown = await pixels(page);
  await drag(page, [dirname(FOLDERS.archives)], "dropped");
  await rested(page, 2);
  expect((await pixels(page)).equals(shown)).toBe(true);
  expect(await page.evaluate(STATE)).toEqual([expect.any(Number), "0-45", 1, ["town", "town"], []]);
});

test("another city replaces the previous one, wherever it is", async () => {
  const far = {
    ...town,
    json: { ...town.json, name: "far", origin: [100, 200, 0] as const, crs: { ...town.json.crs, epsg: 2056, name: "elsewhere" } },
  };
  const folder = writeFolder(far, "far");
  const { page } = await start();
  await drag(page, [FOLDERS.loose], "dropped");
  await rested(page);
  const first = await pixels(page);
  await drag(page, [folder], "dropped");
  await rested(page, 2);
  expect(await page.evaluate("[map.center.map(Math.round).slice(0, 2).every((part) => part < 400), errors]")).toEqual([true, []]);
  expect((await pixels(page)).equals(first)).toBe(true);
  rmSync(dirname(folder), { recursive: true });
});

test.each([
  ["en", "Drop a map folder"],
  ["de", "Kartenordner zum"],
  ["fr", "Déposez un dossier"],
])("a hint in %s is visible while files are over the map", async (language, words) => {
  const { page, problems } = await start({ language }, {}, undrawn);
  const over = page.locator(".map3d-drop");
  expect(await over.isVisible()).toBe(false);
  await drag(page, [FOLDERS.loose], "over");
  await over.waitFor({ state: "visible" });
  expect(await over.innerText()).toContain(words);
  await page.screenshot({ path: `${OUT}/files-over-${language}.png` });
  for (const [to, visible] of [
    ["canvas", true],
    ["html", false],
  ] as const) {
    await page.evaluate((selector) => {
      const [{ map }, relatedTarget] = [globalThis as Global, document.querySelector(selector)];
      map.canvas.dispatchEvent(new DragEvent("dragleave", { bubbles: true, relatedTarget }));
    }, to);
    await animationsEnd(page);
    expect(await over.isVisible()).toBe(visible);
  }
  expect(problems).toEqual([]);
});

test("invalid files show a message and leave the map unchanged", async () => {
  const broken = writeFolder(published(town), "broken");
  unlinkSync(join(broken, "180-45/id.pmtiles"));
  const other = join(dirname(broken), "cat <img src=x onerror=alert(1)>.txt");
  writeFileSync(other, "meow");
  const { page, problems } = await start({}, { viewport: { width: 390, height: 700 } });
  await drag(page, [FOLDERS.archives], "dropped");
  await rested(page);
  const before = await pixels(page);
  const rows: [string[], RegExp][] = [
    [[other], /^This is not a map folder: it has no rendering\.json/],
    [
      [FOLDERS.loose, dirname(broken)],
      /^This folder contains several maps: town\/rendering\.json, map3d-folder-\w+\/broken\/rendering\.json/,
    ],
    [[broken], /^Some files of this map are missing: 180-45\/id\.pmtiles\. Choose the complete folder/],
  ];
  for (const [paths, words] of rows) {
    await drag(page, paths, "dropped");
    await expect.poll(() => said(page), { timeout: 20_000 }).toMatch(words);
  }
  await page.screenshot({ path: `${OUT}/files-missing.png` });
  writeFileSync(join(broken, "rendering.json"), JSON.stringify({ map3d: "rendering", version: 9 }));
  await drag(page, [broken], "dropped");
  await expect.poll(() => said(page), { timeout: 20_000 }).toMatch(/^Couldn’t open the map: rendering\.json: has version 9/);
  expect((await pixels(page)).equals(before)).toBe(true);
  expect(await page.evaluate("[dropped.length, errors.length, map.layers.length]")).toEqual([1, 4, 1]);
  expect(problems).toEqual([]);
  rmSync(dirname(broken), { recursive: true });
});

test("a file that moves after the drop is reported", async () => {
  const folder = writeFolder(published(town), "town");
  const { page } = await start({}, {}, undrawn);
  await drag(page, [folder], "dropped");
  await rested(page);
  renameSync(join(folder, "90-45"), join(folder, "gone"));
  await page.evaluate(() => {
    (globalThis as Global).map.setDirection("90-45");
  });
  await expect
    .poll(() => page.evaluate<string[]>("errors"), { timeout: 20_000 })
    .toContainEqual(expect.stringMatching(/90-45\/color\.pmtiles has changed or moved/));
  rmSync(dirname(folder), { recursive: true });
});

test("dropped files without folders are matched by name; removing the control leaves nothing behind", async () => {
  const { page } = await start({}, {}, undrawn);
  const json = JSON.stringify({
    ...town.json,
    views: town.json.views.map((view) => ({ ...view, archives: { color: "https://evil.example/color.pmtiles" } })),
  });
  await page.evaluate((text) => {
    const data = new DataTransfer();
    data.items.add(new File([text], "rendering.json", { type: "application/json" }));
    (globalThis as Global).map.canvas.dispatchEvent(new DragEvent("drop", { bubbles: true, cancelable: true, dataTransfer: data }));
  }, json);
  await expect
    .poll(() => said(page), { timeout: 20_000 })
    .toMatch(/^Some files of this map are missing: https:\/\/evil\.example\/color\.pmtiles/);
  expect(await page.evaluate("(tool.remove(), document.querySelectorAll('.map3d-drop, .map3d-said, input').length)")).toBe(0);
});

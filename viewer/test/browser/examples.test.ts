import { readdirSync, readFileSync, rmSync } from "node:fs";
import { dirname, join } from "node:path";
import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { published, writeFolder } from "../fixture/folder";
import { VIEWER } from "../fixture/installation";
import { renderLater } from "../fixture/secondEpoch";
import { renderTown } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { OUT } from "./browser";

const bed = new TestBed({ town: renderTown(), later: renderLater() });
const FOLDER = join(VIEWER, "examples");
const FILES = readdirSync(FOLDER).filter((file) => file.endsWith(".html"));
const ORDER = [
  "shortest",
  "markers",
  "attributes",
  "theme",
  "labels",
  "measure",
  "sun",
  "search",
  "company",
  "directions",
  "times",
  "styles",
  "link",
  "model",
  "files",
  "portrayal",
];
const COLOURS = 24;

/** Counts the colours in a part of the page: a map that shows something has many. */
async function colours(page: Page, selector: string): Promise<number> {
  const shot = (await page.locator(selector).first().screenshot()).toString("base64");
  return page.evaluate(async (bytes) => {
    const picture = await createImageBitmap(await (await fetch(`data:image/png;base64,${bytes}`)).blob());
    const pen = new OffscreenCanvas(picture.width, picture.height).getContext("2d") as OffscreenCanvasRenderingContext2D;
    pen.drawImage(picture, 0, 0);
    return new Set(new Uint32Array(pen.getImageData(0, 0, picture.width, picture.height).data.buffer)).size;
  }, shot);
}

/** Waits until the picture no longer changes, in a page whose map is not a global. */
async function still(page: Page): Promise<Buffer> {
  await page.waitForLoadState("networkidle");
  for (let before = await page.screenshot(); ;) {
    await page.waitForTimeout(150);
    const now = await page.screenshot();
    if (now.equals(before)) return now;
    before = now;
  }
}

const text = (page: Page, selector: string): Promise<string> => page.locator(selector).first().innerText();

/** The expected behaviour of each example. */
const POINTS: Readonly<Record<string, (page: Page, picture: Buffer) => Promise<void>>> = {
  shortest: async (page) => {
    expect(await page.evaluate("[map.layers.length, map.drawer, layer.rendering.json.name]")).toEqual([1, "webgl", "town"]);
  },
  markers: async (page) => {
    await page.getByRole("button", { name: "Chapel" }).click();
    expect(await text(page, ".map3d-popup")).toContain("The oldest building, <em>of 1290</em>");
    expect(await page.locator(".map3d-popup em").count()).toBe(0);
  },
  attributes: async (page) => {
    const [x, y] = await page.evaluate<[number, number]>("map.project([691032, 5336026, 562])");
    await page.mouse.click(x, y);
    await page.getByRole("heading", { name: "Tower" }).waitFor();
    expect(await text(page, "dl")).toMatch(/measuredHeight\s+62/);
    expect(await text(page, "dl")).toContain("<img src=x onerror=alert(1)>");
  },
  theme: async (page, before) => {
    expect(await page.locator(".map3d-legend button").count()).toBe(4);
    await page.getByLabel("Colour by").selectOption({ label: "class" });
    await page.locator(".map3d-legend button", { hasText: "terrain" }).waitFor();
    expect(before.equals(await still(page))).toBe(false);
  },
  labels: async (page) => {
    await page.locator(".map3d-label-shown", { hasText: "Tower" }).waitFor();
    await page.locator(".map3d-label-shown", { hasText: "Street" }).first().waitFor();
    await page.screenshot({ path: `${OUT}/example-labels-names.png` });
    await page.getByRole("button", { name: "Names on the map" }).click();
    expect(await page.evaluate("[buildings.visible, streets.visible]")).toEqual([[], []]);
  },
  measure: async (page) => {
    for (const at of ["[690938, 5335978, 534]", "[690972, 5335978, 534]"]) {
      const [x, y] = await page.evaluate<[number, number]>(`map.project(${at})`);
      await page.mouse.click(x + (at.startsWith("[690938") ? 2 : -2), y - 2);
      await page.waitForTimeout(400); // two clicks, not a double one
    }
    await page.waitForFunction(() => /^[\d.]+ m, height difference/.test(document.querySelector("output")?.value ?? ""));
    const length = parseFloat(await text(page, "output"));
    expect(length).toBeGreaterThan(28);
    expect(length).toBeLessThan(34.2);
  },
  sun: async (page, afternoon) => {
    expect(await text(page, "output")).toMatch(/^15:00: sun at elevation \d+°/);
    await page.locator("#hour").fill("23");
    expect(await text(page, "output")).toBe("23:00: the sun has set");
    expect(afternoon.equals(await still(page))).toBe(false);
  },
  search: async (page) => {
    await page.getByRole("searchbox").fill("school old");
    await page.getByRole("button", { name: "School <b>old</b>" }).click();
    await page.waitForFunction("map.zoom === 3 && map.project([691031, 5335968, 516]).map(Math.round).join() === '400,300'"); // there
    expect(await page.evaluate("layer.highlighted")).toEqual([1025]);
    expect(await text(page, ".map3d-marker-selected")).toBe("School <b>old</b>");
  },
  company: async (page) => {
    expect(await text(page, ".map3d-popup")).toContain("Tower Lane 3, first floor");
    expect(await page.locator("map-3d").innerText()).not.toContain("needs a browser");
    const embed = /<!-- From here[^]*all that the map needs/.exec(readFileSync(join(FOLDER, "company.html"), "utf8"))?.[0] ?? "";
    expect(embed.split("\n").length).toBeLessThanOrEqual(24);
  },
  directions: async (page) => {
    await page.mouse.move(200, 200);
    await page.mouse.down();
    await page.mouse.move(230, 215, { steps: 6 });
    await page.waitForTimeout(200); // without inertia
    await page.mouse.up();
    await still(page);
    await page.screenshot({ path: `${OUT}/example-directions-moved.png` });
    const centres = `(async () => {
      const { clientWidth, clientHeight } = sync.leader.container;
      const place = (await sync.leader.pick([clientWidth / 2, clientHeight / 2])).position;
      return maps.map((map) => ({ direction: map.direction, zoom: map.zoom, at: map.project(place).map((part, k) => part - [map.container.clientWidth, map.container.clientHeight][k] / 2) }));
    })()`;
    const found = await page.evaluate<{ direction: string; zoom: number; at: [number, number] }[]>(centres);
    expect(found.map(({ direction }) => direction)).toEqual(["0-45", "270-45", "180-45", "90-45"]);
    expect(new Set(found.map(({ zoom }) => zoom)).size).toBe(1);
    for (const part of found.flatMap(({ at }) => at)) expect(Math.abs(part)).toBeLessThan(1.5);
    const captions = (): Promise<string[]> => page.locator(".map3d-facing").allTextContents();
    expect(await captions()).toEqual(["Facing north", "Facing east", "Facing south", "Facing west"]);
    // A turn of one map turns all of them, each with its own caption.
    await page.getByRole("button", { name: "Turn view clockwise", exact: true }).click();
    await expect.poll(captions, { timeout: 20_000 }).toEqual(["Facing east", "Facing south", "Facing west", "Facing north"]);
    await still(page);
    const [x, y] = await page.evaluate<[number, number]>("maps[0].project([691032, 5336026, 562])");
    await page.mouse.click(x, y);
    await page.waitForFunction("maps.every(({ layers: [layer] }) => layer.highlighted.join() === '2000000001')");
  },
  times: async (page, swiped) => {
    expect(await page.locator(".map3d-swipe-name").allTextContents()).toEqual(["Then", "Now"]);
    await page.getByRole("slider", { name: "Drag to compare" }).press("End");
    expect((await still(page)).equals(swiped)).toBe(false);
    await page.getByRole("button", { name: "Side by side" }).click();
    await still(page);
    await page.screenshot({ path: `${OUT}/example-times-side-by-side.png` });
    expect(
      await page.evaluate(
        "[map, right].map((each) => [each.layers.length, each.layers[0].rendering.json.name, each.direction, each.zoom])",
      ),
    ).toEqual([
      [1, "town", "0-45", 2.6],
      [1, "later", "0-45", 2.6],
    ]);
    expect(await page.evaluate("[before.clip, after.clip]")).toEqual([null, null]);
    await page.getByRole("button", { name: "One map" }).click();
    await still(page);
    expect(
      await page.evaluate("[map.layers.length, before.clip, after.clip, map.zoom, right.container.isConnected && !box.hidden]"),
    ).toEqual([2, [0, 0, 0.5, 1], [0.5, 0, 1, 1], 2.6, false]);
  },
  styles: async (page) => {
    for (const mode of ["normal", "depth"]) expect(await colours(page, `[data-mode=${mode}]`)).toBeGreaterThan(COLOURS / 4);
    await page.locator("[data-mode=depth]").getByRole("button", { name: "Zoom in" }).click();
    await still(page);
    const views = await page.evaluate<[string, number, number[]][]>(
      "maps.map((map) => [map.direction, map.zoom, map.project([691000, 5336000, 500]).map(Math.round)])",
    );
    expect(views[0]).toEqual(views[2]);
    expect(views[1]).toEqual(views[2]);
  },
  link: async (page) => {
    await page.getByLabel(/Language|Sprache|Langue/).selectOption("de");
    await page.getByRole("button", { name: "Drehen" }).click();
    await page.waitForFunction(() => location.hash.startsWith("#90-45/"));
    await page.getByRole("button", { name: "Vergrößern" }).click();
    await still(page);
    const address = page.url();
    await page.goto("about:blank");
    await page.goto(address);
    await page.getByText("Verlinkter Ort").waitFor();
    await still(page);
    const [from, to] = [address, page.url()].map((url) => url.split("/").slice(-4).map(Number)) as [number[], number[]];
    expect(page.url()).toContain("#90-45/");
    expect(Math.hypot(...from.map((part, k) => part - (to[k] ?? 0)))).toBeLessThan(2);
  },
  model: async (page, standing) => {
    await page.mouse.click(400, 338);
    await page.getByText("base, 502.0 m").waitFor();
    await page.getByRole("button", { name: "Rotate the crane" }).click();
    await expect.poll(async () => standing.equals(await page.screenshot()), { timeout: 20_000 }).toBe(false);
    await page.getByRole("button", { name: "Stop the crane" }).click();
    await still(page);
  },
  portrayal: async (page) => {
    expect(await text(page, "#panel")).toMatch(/^A small town\s+Click a building\.$/);
    const [x, y] = await page.evaluate<[number, number]>("map.project([691032, 5336026, 562])");
    await page.mouse.click(x, y);
    await page.getByRole("heading", { name: "Tower" }).waitFor();
    expect(await text(page, "dl")).toContain("<img src=x onerror=alert(1)>");
    await still(page);
    expect(await page.evaluate("[layer.highlighted, source.missing, map.layers.length]")).toEqual([[2_000_000_001], [], 1]);
    await page.screenshot({ path: `${OUT}/example-portrayal-click.png` });
  },
  files: async (page, before) => {
    const folder = writeFolder(published(renderTown(64, 0.76)), "mine");
    const chooser = page.waitForEvent("filechooser");
    await page.getByRole("button", { name: "Open map folder" }).click();
    await (await chooser).setFiles(folder);
    await page.getByText("A small town: 4 views, opened from your device.").waitFor();
    expect((await still(page)).equals(before)).toBe(false);
    expect(await page.evaluate("[map.layers.length, files.layer.source === map.layers[0].source]")).toEqual([1, true]);
    rmSync(dirname(folder), { recursive: true });
  },
};

test("the index lists all examples", () => {
  expect(FILES.sort()).toEqual([...ORDER.map((name) => `${name}.html`), "examples.html"].sort());
  const index = readFileSync(join(FOLDER, "examples.html"), "utf8");
  expect([...index.matchAll(/<li><a href="(\w+)\.html">/g)].map(([, name]) => name)).toEqual(ORDER);
  for (const file of FILES)
    expect(readFileSync(join(FOLDER, file), "utf8")).not.toMatch(/\son\w+=|innerHTML|https?:\/\/(?!.*example\.org)/);
});

test.each(["examples", ...ORDER])("%s", async (name) => {
  const { page, problems } = await bed.openPage({ locale: "en-GB", timezoneId: "Europe/Berlin" });
  await page.goto(`${bed.server.origin}/examples/${name}.html`);
  if (name !== "examples") await page.locator("canvas").first().waitFor();
  const picture = await still(page);
  await page.screenshot({ path: `${OUT}/example-${name}.png` });
  if (name !== "examples") expect(await colours(page, ".map3d")).toBeGreaterThan(COLOURS);
  await POINTS[name]?.(page, picture);
  const nameless = await page
    .locator("button, input, select, a")
    .evaluateAll((all) =>
      all
        .filter((node) => !(node.textContent.trim() || node.ariaLabel || (node as HTMLInputElement).labels?.length))
        .map((node) => node.outerHTML),
    );
  expect(nameless).toEqual([]);
  expect(problems).toEqual([]);
});

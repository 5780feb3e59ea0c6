import { afterAll, beforeAll, describe, expect, test } from "vitest";
import type { Browser, Page } from "playwright-core";
import { renderNoise, renderTown } from "../fixture/rendering";
import { ORIGIN, THINGS } from "../fixture/town";
import { TestServer } from "../fixture/server";
import { openBrowser, openPage, OUT } from "./browser";
import { BARE, type Global } from "./page";

let browser: Browser;
let host: string;
const server = new TestServer();
const town = renderTown();

beforeAll(async () => {
  server.renderings.set("town", town);
  server.pages.set("/bare", BARE);
  server.pages.set("/bare.css", "html,body{margin:0;height:100%}#mapcanvas{width:100%;height:100vh}");
  host = await server.listen();
  browser = await openBrowser();
});

afterAll(async () => {
  await browser.close();
  await server.close();
});

/** A page with a map of the town that has drawn its first complete view. */
async function started(options: object = {}, layer: object = {}, name = "town"): Promise<{ page: Page; problems: string[] }> {
  const opened = await openPage(browser);
  await opened.page.goto(`${host}/bare`);
  await opened.page.evaluate(([base, mapOptions, layerOptions]) => new Promise<void>((done) => {
    const g = globalThis as Global;
    g.map = new g.map3d.map("mapcanvas", { preserveDrawingBuffer: true, ...mapOptions });
    g.layer = new g.map3d.imageLayer(base, layerOptions).addTo(g.map);
    g.errors = [];
    g.clicks = [];
    g.map.on("error", ({ error }) => g.errors.push(error.message));
    g.map.on("click", (event) => g.clicks.push(event));
    g.map.once("idle", () => { done(); });
  }), [`${host}/tiles/${name}`, options, layer] as const);
  return opened;
}

const idle = (page: Page): Promise<void> => page.evaluate(() => new Promise<void>((done) => { (globalThis as Global).map.once("idle", () => { done(); }); }));

test("the first complete view is drawn without an error", async () => {
  const { page, problems } = await started();
  await page.screenshot({ path: `${OUT}/first.png` });
  expect(problems).toEqual([]);
  expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([]);
  await page.context().close();
});

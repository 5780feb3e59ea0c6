// Takes screenshots of a served rendering at the positions of views.json, and of the same town in CesiumJS. Standard input: { playwright: folder, page: address of the
// rendering, views: content of views.json, cesium: folder with 3dtiles/town.json | null, out: output folder }. Keeps existing screenshots.
import { existsSync, readFileSync, renameSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { buildCesium, roots } from "../../bench/viewer/cesium.mjs";
import { Server } from "../../bench/viewer/server.mjs";
import { anyWebGL, launch } from "../../tests/whole/chromium.mjs";
import { build } from "../../viewer/node_modules/esbuild/lib/main.js";

const { playwright, page, views, cesium, out } = JSON.parse(readFileSync(0, "utf8"));
const SOURCES = join(import.meta.dirname, "../../viewer/src");
/** 14:00 local time on a summer day. */
const [DAY, ZONE] = ["2026-06-21T12:00Z", "Europe/Berlin"];
/** Background colour of the viewer. */
const PAPER = "#f2f0eb";
const TILES_BYTES = 2 ** 31;
const LIMIT_MS = 240_000;

const manifest = await (await fetch(`${page}rendering.json`.replace("/view/", "/tiles/"))).json();
const { DEFAULT_LIGHT, computeDaylight } = await compiled('export { computeDaylight } from "./geo/daylight"; export { DEFAULT_LIGHT } from "./geo/light";');
const browser = await launch(playwright);

async function compiled(contents) {
  const { outputFiles } = await build({ stdin: { contents, resolveDir: SOURCES, loader: "ts" }, bundle: true, format: "esm", write: false });
  return import(`data:text/javascript,${encodeURIComponent(outputFiles[0].text)}`);
}

/** Opens a new browser context with an empty cache; `sent` returns the received bytes, headers included. */
async function open({ size: [width, height], dpr }) {
  const context = await browser.newContext({ viewport: { width, height }, deviceScaleFactor: dpr ?? 1, isMobile: dpr !== undefined, hasTouch: dpr !== undefined, colorScheme: "light", timezoneId: ZONE, bypassCSP: true });
  const tab = await context.newPage();
  tab.setDefaultTimeout(LIMIT_MS);
  tab.on("pageerror", (error) => { throw error; });
  const sizes = [];
  tab.on("requestfinished", (request) => { sizes.push(request.sizes().then(({ responseBodySize: body, responseHeadersSize: head }) => body + head)); });
  const sent = async () => (await Promise.all(sizes)).reduce((sum, size) => sum + size, 0);
  return { context, tab, sent };
}

/** Waits until the expected images have arrived and no request was open for two seconds; throws after LIMIT_MS. */
async function quiet(tab, act) {
  const end = performance.now() + LIMIT_MS;
  let [open, images, last] = [0, 0, performance.now()];
  const onRequest = (step) => () => { [open, last] = [open + step, performance.now()]; };
  const [begun, ended] = [onRequest(1), onRequest(-1)];
  const answered = (response) => { images += Number(response.headers()["content-type"]?.startsWith("image/") ?? false); };
  tab.on("request", begun).on("requestfinished", ended).on("requestfailed", ended).on("response", answered);
  const expected = await act();
  while (open > 0 || images < expected || performance.now() - last < 2000) {
    if (performance.now() > end || tab.isClosed()) throw new Error(`${tab.url()}: ${open} requests are still open, ${images} of ${expected} images arrived`);
    await new Promise((done) => setTimeout(done, 100));
  }
  tab.off("request", begun).off("requestfinished", ended).off("requestfailed", ended).off("response", answered);
}

/** Waits until the page shows everything, shadows from depth included: nothing loads and two screenshots are equal. */
async function still(tab) {
  await tab.waitForFunction(() => document.getElementById("loading").hidden);
  for (let before = await tab.screenshot(), equal = 0; equal < 2;) {
    await new Promise((done) => setTimeout(done, 700));
    const now = await tab.screenshot();
    equal = now.equals(before) ? equal + 1 : 0;
    before = now;
  }
}

async function ours(view, path) {
  const { context, tab, sent } = await open(view);
  await context.addInitScript(anyWebGL);
  await quiet(tab, async () => {
    await tab.goto(`${page}#${[view.view, ...view.at.map((part, k) => part + manifest.origin[k]), view.zoom, `t=${view.time ?? DAY}`].join("/")}`);
    return 8;
  });
  await still(tab);
  const bytes = await sent();
  if (view.click) await quiet(tab, async () => { await tab.touchscreen.tap(view.click[0], view.click[1]); return 0; });
  if (view.bare) await tab.addStyleTag({ content: ".card, .map3d-controls { display: none }" });
  await tab.screenshot({ path });
  await context.close();
  return { bytes };
}

async function theirs(view, path, origin) {
  const { context, tab, sent } = await open(view);
  const [look, pitch] = view.view.split("-").map(Number);
  const [x, y, z] = view.at;
  const start = { x, y, z, mpp: manifest.size_m / (manifest.tile_px * 2 ** view.zoom), look, pitch };
  const light = { ...DEFAULT_LIGHT, ...computeDaylight(new Date(view.time ?? DAY), manifest.geographic) };
  const asked = { base: "/3dtiles/town.json", start: JSON.stringify(start), light: JSON.stringify(light), paper: PAPER, resolution: "device", onrequest: "1", cache: TILES_BYTES };
  await tab.goto(`${origin}/pages/cesium.html?${new URLSearchParams(asked)}`);
  await tab.evaluate(() => globalThis.bench.complete);
  const about = await tab.evaluate(() => globalThis.bench.about());
  await tab.screenshot({ path });
  const bytes = await sent();
  await context.close();
  return { bytes, triangles: about.triangles };
}

/** Takes a screenshot unless it exists, and writes its facts into a JSON file next to it. */
async function take(view, viewer, act) {
  const path = join(out, `${view.name}-${viewer}.png`);
  if (existsSync(path)) return;
  const draft = join(out, `draft-${viewer}.png`);
  const facts = await act(view, draft);
  writeFileSync(path.replace(/png$/, "json"), JSON.stringify(facts));
  renameSync(draft, path);
  console.log(view.name, viewer, JSON.stringify(facts));
}

for (const view of views) await take(view, "map3d", ours);
if (cesium !== null) {
  await buildCesium(cesium);
  const server = new Server(cesium, roots(cesium));
  await server.listen();
  for (const view of views.filter(({ alone }) => !alone)) await take(view, "cesium", (...given) => theirs(...given, server.origin));
  server.close();
}
await browser.close();

import { execFile } from "node:child_process";
import { join } from "node:path";
import { promisify } from "node:util";
import * as esbuild from "esbuild";
import { build as viteBuild, type Rolldown } from "vite";
import { afterAll, beforeAll, expect, test } from "vitest";
import { TestBed } from "../browser/testBed";
import { Installation, VIEWER } from "../fixture/installation";
import { renderTown } from "../fixture/rendering";

const bed = new TestBed({ town: renderTown() });
const run = promisify(execFile);

/** A small app that uses the core and all entries that are named here; its types are checked, too. */
const APP = `
import { Evented, imageLayer, map, marker, type ClickEvent, type Vec3 } from "map3d";
import "map3d/element";
import { measure, measureLine, type LineMeasure } from "map3d/measure";
import { theme } from "map3d/theme";

const hall: Vec3 = [690955, 5335996, 534];
const view = new map("mapcanvas", { language: "en" });
const layer = new imageLayer("tiles/town").addTo(view);
new marker("Town hall", hall).addTo(view);
const colors = new theme(layer, "measuredHeight").addTo(view);
const length: LineMeasure = measureLine([hall, [690955, 5335996, 500]]);
// @ts-expect-error a layer has an address
void (() => new imageLayer(5));
document.addEventListener("map-click", ({ detail }: CustomEvent<ClickEvent>) => detail.name);
const element = document.createElement("map-3d");
element.setAttribute("src", "tiles/town");
document.body.append(element);
const resting = new Promise((done) => element.addEventListener("map-idle", done));
await new Promise((done) => { colors.once("ready", () => { view.once("idle", done); }); });
await resting;
const town = await layer.object(17);
Object.assign(globalThis, { found: { name: town?.name, height: town?.attributes["measuredHeight"], length: length.length_m, one: new measure() instanceof Evented && element.map instanceof map, classes: colors.classes.length } });
`;
const settings = (module: string, moduleResolution: string): string =>
  JSON.stringify({
    compilerOptions: {
      target: "es2022",
      lib: ["es2023", "dom", "dom.iterable"],
      strict: true,
      exactOptionalPropertyTypes: true,
      noEmit: true,
      types: [],
      module,
      moduleResolution,
    },
    files: ["app.ts"],
  });

let installed: Installation;
beforeAll(() => {
  installed = new Installation({
    "package.json": '{ "type": "module" }',
    "app.ts": APP,
    "full.ts": APP.replaceAll(/"map3d(\/\w+)?"/g, '"map3d/full"'),
    "bundler.json": settings("esnext", "bundler"),
    "node16.json": settings("node16", "node16"),
  });
});
afterAll(() => {
  installed.remove();
});

test.each(["bundler", "node16"])("types are found with moduleResolution %s", async (kind) => {
  const { stdout } = await run(process.execPath, [
    join(VIEWER, "node_modules/typescript/bin/tsc"),
    "-p",
    installed.path(`${kind}.json`),
  ]).catch((reason: unknown) => reason as { stdout: string });
  expect(stdout).toBe("");
});

const bundlers: Record<string, (entry: string) => Promise<string>> = {
  esbuild: async (entry) =>
    (await esbuild.build({ entryPoints: [entry], bundle: true, minify: true, format: "esm", write: false })).outputFiles[0]?.text ?? "",
  vite: async (entry) => {
    const made = (await viteBuild({
      root: installed.folder,
      configFile: false,
      logLevel: "error",
      build: { write: false, target: "es2022", rolldownOptions: { input: entry } },
    })) as Rolldown.RolldownOutput;
    expect(made.output.length).toBe(1);
    return made.output[0].code;
  },
};

test.each([
  ["esbuild", "app.ts"],
  ["vite", "app.ts"],
  ["esbuild", "full.ts"],
])("an app bundled by %s from %s runs, with one core and workers from a blob", async (bundler, entry) => {
  const code = (await bundlers[bundler]?.(installed.path(entry))) ?? "";
  expect(code.match(/an imageLayer needs/g)?.length).toBe(1);
  bed.server.pages
    .set("/app.js", code)
    .set(
      "/app",
      '<!doctype html><html lang="en"><head><title>app</title><link rel="icon" href="data:,"><link rel="stylesheet" href="/bare.css"></head><body><canvas id="mapcanvas"></canvas><script type="module" src="/app.js"></script></body></html>',
    );
  const { page, problems } = await bed.openPage();
  const workers: string[] = [];
  page.on("worker", (worker) => {
    workers.push(worker.url());
  });
  await page.goto(`${bed.server.origin}/app`);
  await page.waitForFunction(() => "found" in globalThis);
  expect(await page.evaluate(() => (globalThis as unknown as { found: unknown }).found)).toEqual({
    name: "Town hall",
    height: 34,
    length: 34,
    one: true,
    classes: 5,
  });
  expect(workers.length).toBeGreaterThan(0);
  for (const url of workers) expect(url).toMatch(/^blob:/);
  expect(problems).toEqual([]);
});

import { execFile } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { promisify } from "node:util";
import * as esbuild from "esbuild";
import { build as viteBuild, type Rolldown } from "vite";
import { afterAll, beforeAll, expect, test } from "vitest";
import { ENTRIES } from "../../scripts/entries.mjs";
import { renderTown } from "../fixture/rendering";
import { serve, TestBed } from "./testBed";
import { Installation, VIEWER } from "./package";

const town = renderTown();
const bed = new TestBed({ town });
const elsewhere = serve({ town });
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
const settings = (module: string, moduleResolution: string): string => JSON.stringify({ compilerOptions: { target: "es2022", lib: ["es2023", "dom", "dom.iterable"], strict: true, exactOptionalPropertyTypes: true, noEmit: true, types: [], module, moduleResolution }, files: ["app.ts"] });

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
afterAll(() => { installed.remove(); });

test("the package has what it names, and nothing else", () => {
  const names = ["map3d", "map3d-full", ...Object.keys(ENTRIES).map((name) => `map3d-${name}`)];
  const wanted = ["LICENSE", "README.md", "package.json", ...["index.html", "start.js", "page.js", "page-share.js", "page.css", "map3d-worker.js", "map3d.d.ts", "map3d-full.d.ts", ...names.flatMap((name) => [`${name}.js`, `${name}.module.js`, `${name}.module.d.ts`])].map((file) => `dist/${file}`)];
  expect(installed.files.filter((file) => !file.startsWith("dist/types/")).sort()).toEqual(wanted.sort());
  expect(installed.files.filter((file) => file.startsWith("dist/types/") && !file.endsWith(".d.ts"))).toEqual([]);
  expect(readFileSync(join(VIEWER, "LICENSE"), "utf8")).toBe(readFileSync(join(VIEWER, "../LICENSE"), "utf8"));
  const declarations = installed.files.filter((file) => /\.d\.m?ts$/.test(file));
  const lost = declarations.flatMap((file) => [...readFileSync(installed.path(`node_modules/map3d/${file}`), "utf8").matchAll(/(?:from |import\()"([^"]+)"/g)]
    .map(([, to = ""]) => join(file, "..", to.replace(/\.js$/, ".d.ts"))).filter((to) => !installed.files.includes(to)));
  expect(lost).toEqual([]);
});

test.each(["bundler", "node16"])("types are found with moduleResolution %s", async (kind) => {
  const { stdout } = await run(process.execPath, [join(VIEWER, "node_modules/typescript/bin/tsc"), "-p", installed.path(`${kind}.json`)]).catch((reason: unknown) => reason as { stdout: string });
  expect(stdout).toBe("");
});

test("every entry can be imported where there is no page", async () => {
  const lines = ["map3d", ...["full", ...Object.keys(ENTRIES)].map((name) => `map3d/${name}`)].map((name) => `Object.keys(await import("${name}")).length > 0 || process.exit(3);`);
  await run(process.execPath, ["--input-type=module", "-e", lines.join("\n")], { cwd: installed.folder });
  const full = await run(process.execPath, ["--input-type=module", "-e", `
    const full = await import("map3d/full");
    for (const name of ["map3d", ${Object.keys(ENTRIES).map((name) => `"map3d/${name}"`).join()}]) for (const key of Object.keys(await import(name))) if (!(key in full)) console.log(name, key);`], { cwd: installed.folder });
  expect(full.stdout).toBe("");
});

const bundlers: Record<string, (entry: string) => Promise<string>> = {
  esbuild: async (entry) => (await esbuild.build({ entryPoints: [entry], bundle: true, minify: true, format: "esm", write: false })).outputFiles[0]?.text ?? "",
  vite: async (entry) => {
    const made = (await viteBuild({ root: installed.folder, configFile: false, logLevel: "error", build: { write: false, target: "es2022", rolldownOptions: { input: entry } } })) as Rolldown.RolldownOutput;
    expect(made.output.length).toBe(1);
    return made.output[0].code;
  },
};

test.each([["esbuild", "app.ts"], ["vite", "app.ts"], ["esbuild", "full.ts"]])("an app bundled by %s from %s runs, with one core and workers from a blob", async (bundler, entry) => {
  const code = await bundlers[bundler]?.(installed.path(entry)) ?? "";
  expect(code.match(/an imageLayer needs/g)?.length).toBe(1);
  bed.server.pages.set("/app.js", code).set("/app", '<!doctype html><html lang="en"><head><title>app</title><link rel="icon" href="data:,"><link rel="stylesheet" href="/bare.css"></head><body><canvas id="mapcanvas"></canvas><script type="module" src="/app.js"></script></body></html>');
  const { page, problems } = await bed.openPage();
  const workers: string[] = [];
  page.on("worker", (worker) => { workers.push(worker.url()); });
  await page.goto(`${bed.server.origin}/app`);
  await page.waitForFunction(() => "found" in globalThis);
  expect(await page.evaluate(() => (globalThis as unknown as { found: unknown }).found)).toEqual({ name: "Town hall", height: 34, length: 34, one: true, classes: 5 });
  expect(workers.length).toBeGreaterThan(0);
  for (const url of workers) expect(url).toMatch(/^blob:/);
  expect(problems).toEqual([]);
  await page.context().close();
});

test("a script tag from another host, under a policy that allows just that", async () => {
  const [origin, host] = [bed.server.origin, elsewhere.origin];
  bed.server.policies.set("/guest", `default-src 'none'; script-src ${host}; style-src 'self'; connect-src ${host}; img-src data:; worker-src blob:`);
  bed.server.pages.set("/guest", `<!doctype html><html lang="en"><head><title>guest</title><link rel="icon" href="data:,"><script src="${host}/map3d-full.js"></script></head><body><map-3d src="${host}/tiles/town"></map-3d></body></html>`);
  const { page, problems } = await bed.openPage();
  await page.goto(`${origin}/guest`);
  const found = await page.evaluate(() => new Promise<unknown>((done) => {
    const element = document.querySelector("map-3d");
    element?.addEventListener("map-idle", () => { done([element.map?.drawer, element.layers[0]?.rendering?.json.name]); }, { once: true });
  }));
  expect(found).toEqual(["webgl", "town"]);
  expect(page.workers().map((worker) => worker.url().slice(0, 5))).toEqual(["blob:", "blob:"]);
  expect(problems).toEqual([]);
  await page.context().close();
});

import { execFile } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { promisify } from "node:util";
import { afterAll, beforeAll, expect, test } from "vitest";
import { ENTRIES } from "../../scripts/entries.mjs";
import { Installation, VIEWER } from "../fixture/installation";
import { renderTown } from "../fixture/rendering";
import { serve, TestBed } from "./testBed";

const town = renderTown();
const bed = new TestBed({ town }, { draws: false });
const elsewhere = serve({ town });
const run = promisify(execFile);

let installed: Installation;
beforeAll(() => {
  installed = new Installation({ "package.json": '{ "type": "module" }' });
});
afterAll(() => {
  installed.remove();
});

test("the package has what it names, and nothing else", () => {
  const names = ["map3d", "map3d-full", ...Object.keys(ENTRIES).map((name) => `map3d-${name}`)];
  const wanted = [
    "LICENSE",
    "README.md",
    "package.json",
    ...[
      "index.html",
      "start.js",
      "page.js",
      "page-share.js",
      "page.css",
      "map3d-worker.js",
      "map3d.d.ts",
      "map3d-full.d.ts",
      ...names.flatMap((name) => [`${name}.js`, `${name}.module.js`, `${name}.module.d.ts`]),
    ].map((file) => `dist/${file}`),
  ];
  expect(installed.files.filter((file) => !file.startsWith("dist/types/")).sort()).toEqual(wanted.sort());
  expect(installed.files.filter((file) => file.startsWith("dist/types/") && !file.endsWith(".d.ts"))).toEqual([]);
  expect(readFileSync(join(VIEWER, "LICENSE"), "utf8")).toBe(readFileSync(join(VIEWER, "../LICENSE"), "utf8"));
  const declarations = installed.files.filter((file) => /\.d\.m?ts$/.test(file));
  const lost = declarations.flatMap((file) =>
    [...readFileSync(installed.path(`node_modules/map3d/${file}`), "utf8").matchAll(/(?:from |import\()"([^"]+)"/g)]
      .map(([, to = ""]) => join(file, "..", to.replace(/\.js$/, ".d.ts")))
      .filter((to) => !installed.files.includes(to)),
  );
  expect(lost).toEqual([]);
});

test("every entry can be imported where there is no page", async () => {
  const lines = ["map3d", ...["full", ...Object.keys(ENTRIES)].map((name) => `map3d/${name}`)].map(
    (name) => `Object.keys(await import("${name}")).length > 0 || process.exit(3);`,
  );
  await run(process.execPath, ["--input-type=module", "-e", lines.join("\n")], { cwd: installed.folder });
  const full = await run(
    process.execPath,
    [
      "--input-type=module",
      "-e",
      `
    const full = await import("map3d/full");
    for (const name of ["map3d", ${Object.keys(ENTRIES)
      .map((name) => `"map3d/${name}"`)
      .join()}]) for (const key of Object.keys(await import(name))) if (!(key in full)) console.log(name, key);`,
    ],
    { cwd: installed.folder },
  );
  expect(full.stdout).toBe("");
});

test("a script tag from another host, under a policy that allows just that", async () => {
  const [origin, host] = [bed.server.origin, elsewhere.origin];
  bed.server.policies.set(
    "/guest",
    `default-src 'none'; script-src ${host}; style-src 'self'; connect-src ${host}; img-src data:; worker-src blob:`,
  );
  bed.server.pages.set(
    "/guest",
    `<!doctype html><html lang="en"><head><title>guest</title><link rel="icon" href="data:,"><script src="${host}/map3d-full.js"></script></head><body><map-3d src="${host}/tiles/town"></map-3d></body></html>`,
  );
  const { page, problems } = await bed.openPage();
  await page.goto(`${origin}/guest`);
  const found = await page.evaluate(
    () =>
      new Promise<unknown>((done) => {
        const element = document.querySelector("map-3d");
        element?.addEventListener(
          "map-idle",
          () => {
            done([element.map?.drawer, element.layers[0]?.rendering?.json.name]);
          },
          { once: true },
        );
      }),
  );
  expect(found).toEqual(["webgl", "town"]);
  expect(page.workers().map((worker) => worker.url().slice(0, 5))).toEqual(["blob:", "blob:"]);
  expect(problems).toEqual([]);
});

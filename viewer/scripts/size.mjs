// Prints the gzipped sizes of dist/; fails when a bundle exceeds its budget or has none.
import { readdirSync, readFileSync, statSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { ENTRIES } from "./entries.mjs";

const dist = resolve(dirname(fileURLToPath(import.meta.url)), "../dist");
/** Budgets of `map3d` and `map3d-<entry>` (module and script), gzipped KB. */
const BUDGET = {
  core: 52,
  cluster: 4,
  compare: 5,
  controls: 6,
  debug: 2,
  drag: 2,
  element: 5,
  files: 5,
  filter: 3,
  geojson: 12,
  labels: 5,
  measure: 10,
  model: 6,
  offline: 6,
  orbit: 7,
  portrayal: 14,
  print: 5,
  shade: 5,
  theme: 4,
  tooltip: 2,
  full: 130,
};
/** Budget of the service worker, `map3d-worker.js`. */
const WORKER = 2;
/** Budget of the core, all entries and the page together. */
const TOTAL = 169;

const bundles = new Map(
  ["core", ...Object.keys(ENTRIES), "full"].flatMap((name) =>
    ["module.js", "js"].map((end) => [name === "core" ? `map3d.${end}` : `map3d-${name}.${end}`, BUDGET[name] * 1024]),
  ),
);
bundles.set("map3d-worker.js", WORKER * 1024);
const rows = readdirSync(dist)
  .filter((name) => statSync(join(dist, name)).isFile() && !name.endsWith(".d.ts"))
  .map((name) => ({ name, bytes: statSync(join(dist, name)).size, gz: gzipSync(readFileSync(join(dist, name)), { level: 9 }).length }));
for (const { name, bytes, gz } of rows)
  console.log(
    `${name.padEnd(20)} ${String(bytes).padStart(8)} bytes ${String(gz).padStart(7)} gz${bundles.has(name) ? ` of ${bundles.get(name)}` : ""}`,
  );

const over = rows.filter(({ name, gz }) => bundles.has(name) && !(gz <= bundles.get(name))).map(({ name }) => name);
const scripts = [...bundles.keys()].filter((name) => !name.endsWith(".module.js") && name !== "map3d-worker.js");
const total = rows.filter(({ name }) => !scripts.includes(name) && name !== "map3d-full.module.js").reduce((sum, { gz }) => sum + gz, 0);
console.log(`everything     ${String(total).padStart(24)} gz of ${TOTAL * 1024}`);
if (total > TOTAL * 1024) over.push("everything");
if (over.length > 0) {
  console.error(`over budget or without a budget: ${over.join(", ")}`);
  process.exit(1);
}

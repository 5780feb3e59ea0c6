// Prints gzipped sizes of what is delivered; fails when the core is over its budget.
import { readdirSync, readFileSync, statSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

const dist = resolve(dirname(fileURLToPath(import.meta.url)), "../dist");
const BUDGET = { "map3d.mjs": 50 * 1024, "map3d.js": 50 * 1024, "map3d-measure.mjs": 5 * 1024, "map3d-measure.js": 5 * 1024, "map3d-theme.mjs": 4 * 1024, "map3d-theme.js": 4 * 1024, "map3d-print.mjs": 5 * 1024, "map3d-print.js": 5 * 1024, "map3d-controls.mjs": 6 * 1024, "map3d-controls.js": 6 * 1024 };
const TOTAL = 130 * 1024;

const rows = readdirSync(dist)
  .filter((name) => statSync(join(dist, name)).isFile() && !name.endsWith(".d.ts"))
  .map((name) => ({ name, bytes: statSync(join(dist, name)).size, gz: gzipSync(readFileSync(join(dist, name)), { level: 9 }).length }));
for (const { name, bytes, gz } of rows) console.log(`${name.padEnd(20)} ${String(bytes).padStart(8)} bytes ${String(gz).padStart(7)} gz${name in BUDGET ? ` of ${BUDGET[name]}` : ""}`);

const over = rows.filter(({ name, gz }) => gz > (BUDGET[name] ?? Infinity));
const total = rows.filter(({ name }) => !name.endsWith(".js") || name === "page.js").reduce((sum, { gz }) => sum + gz, 0);
console.log(`everything     ${String(total).padStart(22)} gz of ${TOTAL}`);
if (over.length > 0 || total > TOTAL) {
  console.error(`over budget: ${over.map(({ name }) => name).join(", ") || "everything"}`);
  process.exit(1);
}

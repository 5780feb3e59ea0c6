// Serves the examples with a small generated town, rendered at startup.
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import * as esbuild from "esbuild";

const root = resolve(dirname(fileURLToPath(import.meta.url)), "..");
const contents =
  'export { renderTown } from "./test/fixture/rendering"; export { renderLater } from "./test/fixture/secondEpoch"; export { TestServer } from "./test/fixture/server";';
// The fixture finds dist/ and examples/ relative to its source folder.
const define = { "import.meta.dirname": JSON.stringify(join(root, "test/fixture")) };
const result = await esbuild.build({
  stdin: { contents, resolveDir: root },
  bundle: true,
  platform: "node",
  format: "esm",
  write: false,
  define,
});
const folder = mkdtempSync(join(root, "node_modules/.examples-"));
writeFileSync(join(folder, "fixture.mjs"), result.outputFiles[0].text);
const { renderTown, renderLater, TestServer } = await import(pathToFileURL(join(folder, "fixture.mjs")).href);
rmSync(folder, { recursive: true });

const server = new TestServer();
server.renderings.set("town", renderTown());
server.renderings.set("later", renderLater());
console.log(`${await server.listen()}/examples/examples.html`);

// Reads archives over HTTP with the reference reader. Standard input: { reader, archives: { URL: [[z, x, y], …] } }; output: { URL: [SHA-256 or null, …] }.
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { reader, archives } = JSON.parse(readFileSync(0, "utf8"));
const { PMTiles } = await import(pathToFileURL(reader).href);
const found = {};
for (const [url, tiles] of Object.entries(archives)) {
  const archive = new PMTiles(url);
  found[url] = [];
  for (const [z, x, y] of tiles) {
    const tile = await archive.getZxy(z, x, y);
    found[url].push(tile ? createHash("sha256").update(new Uint8Array(tile.data)).digest("hex") : null);
  }
}
console.log(JSON.stringify(found));

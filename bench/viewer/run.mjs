// Takes the samples for bench/viewer.py. Standard input: { work, peers, cities, reps, length, use_s, idle_s, free, only, out, pictures }. Each sample is a line of `out`;
// existing samples are not taken again. Viewers take turns in each round.
import { appendFileSync, existsSync, mkdirSync, readFileSync } from "node:fs";
import { loadavg } from "node:os";
import { join } from "node:path";
import { buildCesium, modules, roots } from "./cesium.mjs";
import * as measures from "./measures.mjs";
import * as paths from "./paths.mjs";
import { Server } from "./server.mjs";

const asked = JSON.parse(readFileSync(0, "utf8"));
const { cities, work, free } = asked;
/** A mobile network: 10 Mbit/s, round trip 40 ms. */
const NETWORK = { latency: 40, downloadThroughput: 10e6 / 8, uploadThroughput: 5e6 / 8 };

if (asked.peers) await buildCesium(work);
const server = new Server(work, { ...roots(work), map3d: join(work, "published", cities[0]), city: join(work, "published"), peers: modules });
await server.listen();

const page = (name, query) => `${server.origin}/pages/${name}.html?${new URLSearchParams(query)}`;
const district = paths.district(asked.length);
const pan = paths.pan(asked.length);
const middle = cities.includes("1e6") ? "1e6" : cities.at(-1);
const whole = paths.whole(asked.length, asked.width_m[middle]);
/** Short paths, because with software GL a frame at pixel ratio 3 takes seconds. */
const [districtFew, wholeFew, panFew] = [paths.district(8), paths.whole(8, asked.width_m[middle]), paths.pan(8)];
const at = ({ start }) => ({ start: JSON.stringify(start) });

const map3d = (city, path, more = {}) => page("map3d", { base: `${server.origin}/city/${city}`, ...at(path), ...more });
const cesium = (tiles, path, more = {}) => page("cesium", { base: `${server.origin}/3dtiles/${tiles}.json`, ...at(path), ...more });
const flat = (name) => page(name, { base: `${server.origin}/plain/${middle}`, mode: "color", ...at(pan) });
/** By default CesiumJS draws CSS pixels and map3d.js device pixels; "-css" viewers draw CSS pixels. */
const [DEVICE, CSS] = [{ resolution: "device" }, { ratio: "1" }];

/** Yields [measure, viewer, city, function] in the order of a round. */
function* round() {
  for (const city of cities) {
    yield ["first", "map3d", city, () => measures.first(server, map3d(city, district))];
    if (asked.peers) yield ["first", "cesium-css", city, () => measures.first(server, cesium(city, district))];
  }
  yield ["first-network", "map3d", middle, () => measures.first(server, map3d(middle, district), NETWORK)];
  if (asked.peers) yield ["first-network", "cesium-css", middle, () => measures.first(server, cesium(middle, district), NETWORK)];
  for (const city of cities) {
    yield ["frames", "map3d-css", city, () => measures.frames(server, map3d(city, district, CSS), district, { free })];
    if (asked.peers) yield ["frames", "cesium-css", city, () => measures.frames(server, cesium(city, district), district, { free })];
  }
  yield ["frames", "map3d", middle, () => measures.frames(server, map3d(middle, district), districtFew, { free })];
  if (asked.peers) yield ["frames", "cesium", middle, () => measures.frames(server, cesium(middle, district, DEVICE), districtFew, { free })];
  yield ["whole", "map3d-css", middle, () => measures.frames(server, map3d(middle, whole, CSS), wholeFew, { free })];
  if (asked.peers) yield ["whole", "cesium-css", middle, () => measures.frames(server, cesium(`${middle}-far`, whole), wholeFew, { free })];
  for (const name of asked.peers ? ["map3d", "openseadragon", "leaflet"] : ["map3d"]) {
    yield ["color-first", name, middle, () => measures.first(server, flat(name))];
    yield ["color-frames", name, middle, () => measures.frames(server, flat(name), panFew, { walks: 3, free })];
  }
}

/** Yields the long measures, taken once: minutes of use, then a minute idle. */
function* once() {
  const empty = page("empty", at(district));
  const times = { use_s: asked.use_s, idle_s: asked.idle_s };
  yield ["stays", "map3d", middle, () => measures.stays(server, map3d(middle, district), empty, district, times)];
  if (!asked.peers) return;
  yield ["stays", "cesium-css", middle, () => measures.stays(server, cesium(middle, district), empty, district, times)];
  yield ["stays", "cesium-css-onrequest", middle, () => measures.stays(server, cesium(middle, district, { onrequest: "1" }), empty, district, { ...times, use_s: 5 })];
}

const done = new Map();
mkdirSync(work, { recursive: true });
if (existsSync(asked.out)) for (const line of readFileSync(asked.out, "utf8").split("\n").filter(Boolean)) count(JSON.parse(line));

function count({ measure, viewer, city }) {
  const key = `${measure} ${viewer} ${city}`;
  done.set(key, (done.get(key) ?? 0) + 1);
}

async function take([measure, viewer, city, act], wanted) {
  if ((done.get(`${measure} ${viewer} ${city}`) ?? 0) >= wanted) return;
  const load = loadavg()[0];
  const sample = { measure, viewer, city, load, ...(await act()) };
  appendFileSync(asked.out, `${JSON.stringify(sample)}\n`);
  count(sample);
  console.error(`bench: round ${wanted}: ${measure}, ${viewer}, ${city} (load ${load.toFixed(1)})${sample.problems ? `: ${sample.problems.join("; ")}` : ""}`);
}

for (let number = 1; number <= asked.reps; number++) {
  for (const what of round()) if (asked.only === null || asked.only.includes(what[0])) await take(what, number);
}
for (const what of once()) if (asked.only === null || asked.only.includes(what[0])) await take(what, 1);
for (const [name, url] of asked.pictures ? [["map3d", map3d(middle, district)], ["cesium", cesium(middle, district, DEVICE)], ["whole-map3d", map3d(middle, whole)], ["whole-cesium", cesium(`${middle}-far`, whole)], ["leaflet", flat("leaflet")], ["openseadragon", flat("openseadragon")], ["color-map3d", flat("map3d")]] : []) {
  await measures.picture(url, join(work, `${name}.jpg`));
}
server.close();
if (server.missing.length > 0) {
  console.error(`bench: the pages requested missing files: ${[...new Set(server.missing)].slice(0, 5).join(", ")}`);
  process.exit(1);
}
process.exit(0);

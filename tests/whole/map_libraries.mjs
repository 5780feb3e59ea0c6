// Draws tiles of the services with OpenLayers, Leaflet and MapLibre, in a page of another origin, and takes a screenshot.
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { dirname, extname, join } from "node:path";
import { runPage } from "./chromium.mjs";

const MODULES = dirname(process.argv[2]);
const TYPES = { ".js": "text/javascript", ".mjs": "text/javascript", ".css": "text/css", ".png": "image/png" };
const PAGE = '<!doctype html><meta charset="utf-8"><style>html, body, #map { margin: 0; width: 100%; height: 100%; background: #f0f; }</style>';

const HEADS = {
  openlayers: '<link rel="stylesheet" href="/ol/ol.css"><script src="/ol/dist/ol.js"></script>',
  leaflet: '<link rel="stylesheet" href="/leaflet/dist/leaflet.css"><script src="/leaflet/dist/leaflet.js"></script>',
  maplibre: '<link rel="stylesheet" href="/maplibre-gl/dist/maplibre-gl.css">',
};

/** Recipes of docs/gis-clients.md. Each resolves once all tiles are drawn. */
const DRAW = {
  async "openlayers wmts"({ address, view, center, pixel_m }) {
    const text = await (await fetch(`${address}/wmts/1.0.0/WMTSCapabilities.xml`)).text();
    const capabilities = new ol.format.WMTSCapabilities().read(text);
    const { SupportedCRS } = capabilities.Contents.TileMatrixSet.find(({ Identifier }) => Identifier === view);
    const plane = new ol.proj.Projection({ code: SupportedCRS, units: "m" });
    ol.proj.addProjection(plane);
    const options = ol.source.WMTS.optionsFromCapabilities(capabilities, { layer: view });
    const layer = new ol.layer.Tile({ source: new ol.source.WMTS(options) });
    const map = new ol.Map({ target: "map", controls: [], layers: [layer], view: new ol.View({ projection: plane, center, resolution: pixel_m }) });
    await new Promise((done) => map.once("rendercomplete", done));
  },
  async "openlayers ogc"({ address, view, center, pixel_m }) {
    const plane = new ol.proj.Projection({ code: "plane", units: "m" });
    const source = new ol.source.OGCMapTile({ url: `${address}/ogc/collections/${view}/map/tiles/${view}`, projection: plane });
    const map = new ol.Map({ target: "map", controls: [], layers: [new ol.layer.Tile({ source })], view: new ol.View({ projection: plane, center, resolution: pixel_m }) });
    await new Promise((done, fail) => {
      const check = () => {
        if (source.getState() === "ready") done();
        else if (source.getState() === "error") fail(source.getError?.() ?? new Error("the source has an error"));
      };
      source.on("change", check);
      check();
    });
    // Frames before that were complete without tiles.
    await new Promise((done) => {
      map.once("rendercomplete", done);
      map.render();
    });
  },
  async leaflet({ address, rendering, view_id, center, square, zmax }) {
    const scale = 256 / square.size_m;
    const crs = L.extend({}, L.CRS.Simple, { transformation: new L.Transformation(scale, -square.u0_m * scale, -scale, square.v0_m * scale) });
    const map = L.map("map", { crs, attributionControl: false, zoomControl: false, fadeAnimation: false, zoomAnimation: false }).setView([center[1], center[0]], zmax);
    const layer = L.tileLayer(`${address}/xyz/${rendering}/${view_id}/{z}/{x}/{y}.png`, { maxZoom: zmax, noWrap: true }).addTo(map);
    await new Promise((done) => layer.once("load", done));
  },
  async maplibre({ address, rendering, view_id, lon_lat, zmax }) {
    const { Map: GlMap, setWorkerUrl } = await import("/maplibre-gl/dist/maplibre-gl.mjs");
    setWorkerUrl?.("/maplibre-gl/dist/maplibre-gl-worker.mjs");
    const tiles = { type: "raster", url: `${address}/tilejson/${rendering}/${view_id}.json`, tileSize: 256 };
    const layers = [{ id: "background", type: "background", paint: { "background-color": "#f0f" } }, { id: "tiles", type: "raster", source: "tiles", paint: { "raster-fade-duration": 0 } }];
    const map = new GlMap({ container: "map", attributionControl: false, center: lon_lat, zoom: zmax - 1, style: { version: 8, sources: { tiles }, layers } });
    globalThis.failed = [];
    map.on("error", ({ error }) => failed.push(error.message));
    await new Promise((done) => map.once("idle", done));
    if (failed.length > 0) throw new Error(failed.join("; "));
  },
};

/** Serves the page and the libraries at an origin of their own. */
async function serve(library) {
  const server = createServer(async (request, response) => {
    const { pathname } = new URL(request.url, "http://localhost");
    const html = `${PAGE}${HEADS[library]}<link rel="icon" href="data:,"><div id="map"></div>`;
    const [type, body] = pathname === "/" ? ["text/html", html] : [TYPES[extname(pathname)], await readFile(join(MODULES, pathname)).catch(() => null)];
    response.writeHead(body === null ? 404 : 200, { "Content-Type": type ?? "application/octet-stream" }).end(body);
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  return server;
}

await runPage(async (page, asked) => {
  const server = await serve(asked.client.split(" ")[0]);
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  await page.evaluate(`(${DRAW[asked.client].toString().replace(/^async ("[^"]+"|\w+)/, "async function draw")})(${JSON.stringify(asked)})`);
  await page.screenshot({ path: asked.screenshot });
  server.close();
  server.closeAllConnections();
  return {};
});

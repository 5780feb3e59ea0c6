// Shows a rendering twice, from its tiles and from a 3D Portrayal Service. Parameters: origin, rendering, service, view, targets ([position, zoom]), positions (world, to pick), size, picture.
// Result: shots: for each mode and target, the number of pixels that differ, and of colours; dark: pixels that another light changes, and that differ after it; picks: those of the tiles and of the service; requests: the service's, by image layers.
import { runPage } from "./chromium.mjs";

const MODES = ["lit", "color", "normal", "id", "depth"];

await runPage(async (page, { origin, rendering, service, view, targets, positions, picture }) => {
  const requests = {};
  page.on("request", (request) => {
    const images = /IMAGELAYERS=([A-Z,]+)/.exec(request.url())?.[1] ?? /request=(\w+)/.exec(request.url())?.[1];
    if (images && request.url().includes("/3dps")) requests[images] = (requests[images] ?? 0) + 1;
  });
  await page.goto(`${origin}/view/${rendering}/`);
  for (const name of ["map3d.js", "map3d-portrayal.js"]) await page.addScriptTag({ url: `${origin}/view/${rendering}/${name}` });
  await page.evaluate(async ([base, url, direction]) => {
    const open = async (id, source) => {
      const map = new map3d.map(id, { controls: false, attribution: false, preserveDrawingBuffer: true, direction });
      const errors = [];
      map.on("error", ({ error }) => errors.push(error.message));
      const layer = new map3d.imageLayer(source).addTo(map);
      await new Promise((done, fail) => {
        layer.once("error", ({ error }) => fail(error));
        map.once("idle", done);
      });
      return { map, layer, errors };
    };
    document.body.replaceChildren(...["tiles", "service"].map((id) => Object.assign(document.createElement("canvas"), { id })));
    for (const id of ["tiles", "service"]) Object.assign(document.getElementById(id).style, { position: "fixed", inset: "0", width: "100vw", height: "100vh" });
    Object.assign(globalThis, { maps: [await open("tiles", base), await open("service", map3d.portrayalSource(url))] });
    globalThis.pixels = (map) => {
      const gl = map.canvas.getContext("webgl2");
      const data = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
      gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, data);
      return new Uint32Array(data.buffer);
    };
    globalThis.differing = (a, b) => a.reduce((count, value, k) => count + Number(value !== b[k]), 0);
    globalThis.change = (act) => Promise.all(maps.flatMap(({ map, layer }) => [new Promise((done) => map.once("idle", done)), act(map, layer)]));
  }, [`${origin}/tiles/${rendering}`, service, view]);
  const shots = await page.evaluate(async ([modes, wanted]) => {
    const found = [];
    for (const [position, zoom] of wanted) {
      await change((map) => map.setView(position, zoom));
      for (const mode of modes) {
        if (maps[0].layer.mode !== mode) await change((map, layer) => layer.setMode(mode));
        const [tiles, service] = maps.map(({ map }) => pixels(map));
        found.push({ mode, zoom, differing: differing(tiles, service), colours: new Set(service).size });
      }
      await change((map, layer) => layer.setMode("lit"));
    }
    return found;
  }, [MODES, targets]);
  const light = await page.evaluate(async () => {
    const before = pixels(maps[1].map);
    await change((map) => map.setLight({ azimuth_deg: 20, elevation_deg: 12 }));
    const [tiles, service] = maps.map(({ map }) => pixels(map));
    return { changed: differing(before, service), differing: differing(tiles, service) };
  });
  const picks = await page.evaluate((places) => Promise.all(maps.map(({ map, layer }) => Promise.all(places.map(async (place) => {
    const { id, position, approximate } = await map.pick(map.project(place));
    const { name, class: kind, attributes } = (await layer.object(id)) ?? {};
    return { id, position, approximate, name, kind, attributes: Object.fromEntries(Object.entries(attributes ?? {}).map(([key, value]) => [key, String(value)])) };
  })))), positions);
  await page.screenshot({ path: picture });
  const state = await page.evaluate(() => ({ errors: maps.flatMap(({ errors }) => errors), json: maps.map(({ layer }) => layer.rendering.json), missing: maps[1].layer.source.missing }));
  return { shots, light, picks, requests, ...state };
});

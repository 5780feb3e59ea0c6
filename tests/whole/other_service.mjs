// Shows layers of services of other makers. Parameters: hosts, page, shown: [{ service, options, view, zoom, places }], faults: [service], pictures, size.
// Result: shown: for each of them the state and what is at each place; faults: the first error of a layer of each service.
import { runPage } from "./chromium.mjs";

await runPage(async (page, { page: address, shown, faults, pictures }) => {
  await page.goto(address);
  for (const name of ["map3d.js", "map3d-portrayal.js"]) await page.addScriptTag({ url: `${address}${name}` });
  const answers = [];
  for (const [k, each] of shown.entries()) {
    answers.push(await page.evaluate(async ({ service, options, view, zoom, places }) => {
      const map = new map3d.map("map", { controls: false, preserveDrawingBuffer: true, direction: view, language: "en" });
      const errors = [];
      map.on("error", ({ error }) => errors.push(error.message));
      const source = map3d.portrayalSource(service, options);
      const layer = new map3d.imageLayer(source, { mode: "color" }).addTo(map);
      await new Promise((done, fail) => {
        layer.once("error", ({ error }) => fail(error));
        map.once("idle", done);
      });
      const readPixel = ([x, y]) => {
        const gl = map.canvas.getContext("webgl2");
        const pixel = new Uint8Array(4);
        gl.readPixels(Math.round(x), gl.drawingBufferHeight - 1 - Math.round(y), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        return [...pixel];
      };
      const seen = [];
      for (const place of places) {
        await Promise.all([new Promise((done) => map.once("idle", done)), map.setView(place, zoom)]);
        const at = map.project(place);
        const color = readPixel(at);
        const { id, position, approximate } = await map.pick(at);
        const { name, class: kind, attributes } = (await layer.object(id)) ?? {};
        seen.push({ color, id, position, approximate, name, kind, attributes: attributes && Object.entries(attributes) });
      }
      const { crs, origin, box, zmax, layers, attribution, title } = layer.rendering.json;
      const lit = layer.rendering.layers.has("normal");
      let light = null;
      if (lit) {
        await Promise.all([new Promise((done) => map.once("idle", done)), layer.setMode("lit")]);
        const before = readPixel(map.project(places.at(-1)));
        await Promise.all([new Promise((done) => map.once("idle", done)), map.setLight({ elevation_deg: 5, azimuth_deg: 0 })]);
        light = [before, readPixel(map.project(places.at(-1)))];
      }
      layer.setMode("normal");
      globalThis.opened = map;
      return { seen, errors, missing: source.missing, light, crs, origin, box, zmax, layers: layers.map(({ kind, format }) => [kind, format]), attribution, title };
    }, each));
    await page.screenshot({ path: pictures[k] });
    await page.evaluate(() => globalThis.opened.remove());
  }
  const failed = await page.evaluate(async (services) => {
    const errors = [];
    const map = new map3d.map("map", { controls: false }).on("error", () => undefined);
    for (const service of services) {
      const layer = new map3d.imageLayer(map3d.portrayalSource(service, { views: ["0-45"] }), { mode: "color" });
      errors.push(await new Promise((done) => {
        layer.once("error", ({ error }) => done([error.name, error.message])).addTo(map);
      }));
      layer.remove();
    }
    map.remove();
    return errors;
  }, faults);
  return { shown: answers, faults: failed };
});

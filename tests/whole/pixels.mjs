// Reads whole tiles from the viewer, and highlights objects. Parameters: origin, rendering, view, zmax, tiles ([x, y] of the deepest level), targets ([id, world position of a pixel's centre]), size (odd sides), picture.
// Result: tiles: { kind: SHA-256 of the numbers of each tile, null where empty }; changed: one byte per canvas pixel, 1 where a highlight changed it, base64, rows from the top.
import { runPage, openMap } from "./chromium.mjs";

await runPage(async (page, { origin, rendering, view, zmax, tiles, targets, picture }) => {
  await openMap(page, { origin, rendering, view, options: { controls: false, attribution: false, preserveDrawingBuffer: true } });
  const read = await page.evaluate(async ([name, z, wanted]) => {
    const hex = async (numbers) => [...new Uint8Array(await crypto.subtle.digest("SHA-256", numbers))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
    const { layer } = globalThis;
    const answer = {};
    for (const kind of ["id", "depth"]) {
      const one = async ([x, y]) => layer.tiles.fetch(layer.rendering.views.get(name), layer.rendering.layers.get(kind), { z, x, y });
      answer[kind] = await Promise.all(wanted.map(async (tile) => { const data = await one(tile); return data && hex(data.values); }));
    }
    return answer;
  }, [view, zmax, tiles]);
  const changed = [];
  for (const [id, position] of targets) {
    changed.push(await page.evaluate(async ([number, world, level]) => {
      const { map, layer } = globalThis;
      const idle = () => new Promise((done) => map.once("idle", done));
      const readPixels = () => {
        const gl = map.canvas.getContext("webgl2");
        const data = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
        gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, data);
        return new Uint32Array(data.buffer);
      };
      await Promise.all([idle(), map.setView(world, level)]);
      const before = readPixels();
      await Promise.all([idle(), layer.highlight(number, { color: "#00ffff" })]);
      const after = readPixels();
      await Promise.all([idle(), layer.clearHighlight()]);
      if (readPixels().some((pixel, k) => pixel !== before[k])) throw new Error(`clearing the highlight of ${number} did not restore the image`);
      const width = map.canvas.width;
      const rows = Array.from({ length: map.canvas.height }, (_, j) => after.subarray(j * width, (j + 1) * width).map((pixel, i) => Number(pixel !== before[j * width + i])));
      return btoa(rows.reverse().map((row) => String.fromCharCode(...row)).join(""));
    }, [id, position, zmax]));
  }
  await page.screenshot({ path: picture });
  return { tiles: read, changed };
});

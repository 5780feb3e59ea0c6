import { expect, test } from "vitest";
import { renderNoise, renderTown } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { cosine, decodedLevel, litByte, placeOf, spread, type Shares } from "./level";
import { pixels, settled, type Global } from "./page";

const town = renderTown();

const bed = new TestBed({ town });
const undrawn = new TestBed(bed.server, { draws: false });

/** A page with a map of the town at rest. */
const started = (options: object = {}, name = "town", from = bed): ReturnType<TestBed["start"]> => from.start(name, options);

/** The same, without drawing. */
const recorded = (options: object = {}, name = "town"): ReturnType<TestBed["start"]> => started(options, name, undrawn);

test("the first complete view is drawn without an error", async () => {
  const { page, problems } = await started();
  await page.screenshot({ path: `${OUT}/first.png` });
  expect(problems).toEqual([]);
  expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([]);
  const covered = await page.evaluate(() => {
    const { canvas } = (globalThis as Global).map;
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d") as OffscreenCanvasRenderingContext2D;
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    return data.filter((value, k) => k % 4 === 3 && value === 255).length / (canvas.width * canvas.height);
  });
  expect(covered).toBeGreaterThan(0.3);
});

test("README's example runs unchanged; markers are at their 3D positions", async () => {
  const { page, problems } = await undrawn.bare();
  const found = await page.evaluate(async (base) => {
    const { map3d } = globalThis as Global;
    const map = new map3d.map("mapcanvas");
    const layer = new map3d.imageLayer([base, base]);
    layer.addTo(map);
    const hall = new map3d.marker("Town hall", [691000 - 45, 5336000 - 4, 534]);
    hall.addTo(map);
    const chapel = new map3d.marker("Chapel", [691000 - 28, 5336000 + 47, 520]).bindPopup("A <b>chapel</b>").addTo(map);
    await new Promise((done) => map.once("idle", done));
    const button = [...document.querySelectorAll<HTMLElement>(".map3d-marker")].find(
      (found) => found.getAttribute("aria-label") === "Town hall",
    ) as HTMLElement;
    const box = button.getBoundingClientRect();
    const at = map.project(hall.position as [number, number, number]) as [number, number];
    chapel.select().openPopup();
    return {
      dx: box.x + box.width / 2 - at[0],
      dy: box.y + box.height / 2 - at[1],
      popup: document.querySelector(".map3d-popup-body")?.textContent,
    };
  }, bed.url("town"));
  await page.screenshot({ path: `${OUT}/listing.png` });
  expect(Math.abs(found.dx)).toBeLessThan(0.1);
  expect(Math.abs(found.dy)).toBeLessThan(0.1);
  expect(found.popup).toBe("A <b>chapel</b>");
  expect(problems).toEqual([]);
});

test("a click on a known object gives its id, its name and a position within a pixel", async () => {
  const { page } = await recorded();
  const roof: [number, number, number] = [ORIGIN[0] - 45, ORIGIN[1] - 4, ORIGIN[2] + 34];
  const at = await page.evaluate((world) => (globalThis as Global).map.project(world) as [number, number], roof);
  await page.mouse.click(at[0], at[1]);
  await page.waitForFunction(() => (globalThis as Global).clicks.length > 0);
  const [click] = await page.evaluate(() =>
    (globalThis as Global).clicks.map(({ id, position, approximate, name, attributes }) => ({
      id,
      position,
      approximate,
      name,
      attributes,
    })),
  );
  expect(click).toMatchObject({ id: 17, approximate: false, name: "Town hall", attributes: { measuredHeight: 34 } });
  const pixel_m = 0.38;
  expect(Math.hypot(...roof.map((part, k) => part - (click?.position?.[k] ?? 0)))).toBeLessThan(2 * pixel_m);
  expect(click?.position?.[2]).toBeCloseTo(ORIGIN[2] + 34, 2);
});

test("a click on nothing reports id 0", async () => {
  const { page } = await recorded();
  await page.mouse.click(5, 5);
  await page.waitForFunction(() => (globalThis as Global).clicks.length > 0);
  expect(await page.evaluate(() => (globalThis as Global).clicks[0]?.id)).toBe(0);
});

test("without light, colours are shown exactly as stored", async () => {
  const { page } = await started({ zoom: 3, light: { lit: false } });
  const got = await pixels(page);
  const stored = decodedLevel(town, "color");
  const [left, top] = await placeOf(page);
  const wrong: string[] = [];
  let compared = 0;
  for (let at = 0; at < 800 * 600; at++) {
    const want = stored((at % 800) - left, Math.floor(at / 800) - top);
    if (!want || want[3] === 0) continue;
    compared++;
    if (!want.equals(got.subarray(4 * at, 4 * at + 4))) wrong.push(`${String(at % 800)}, ${String(Math.floor(at / 800))}`);
  }
  expect(wrong.slice(0, 10)).toEqual([]);
  expect(compared).toBeGreaterThan(50_000);
});

test("each pixel is lit by Lambert's law in linear light, half by its own normal and an eighth by each neighbour's", async () => {
  const light = { azimuth_deg: 200, elevation_deg: 30, ambient: 0.2, diffuse: 0.6 };
  const { page } = await started({ zoom: 3, light });
  const got = await pixels(page);
  const [color, normal] = [decodedLevel(town, "color"), decodedLevel(town, "normal")];
  const [left, top] = await placeOf(page);
  const wrong: string[] = [];
  let compared = 0;
  for (let at = 0; at < 800 * 600; at++) {
    const [x, y] = [(at % 800) - left, Math.floor(at / 800) - top];
    const [c, n] = [color(x, y), normal(x, y)];
    if (!c || !n || c[3] === 0) continue;
    compared++;
    const shares = (stored: Uint8Array | undefined): Shares | null => {
      const cos = stored && cosine(stored, light);
      return cos === undefined || cos === null ? null : [1, cos];
    };
    const [sky, sun] = spread(shares(n) ?? [1, 0.5], [normal(x - 1, y), normal(x + 1, y), normal(x, y - 1), normal(x, y + 1)].map(shares));
    const strength = light.ambient * sky + light.diffuse * sun;
    const want = [0, 1, 2].map((k) => litByte(c[k] ?? 0, strength));
    if (want.some((value, k) => Math.abs(value - (got[4 * at + k] ?? 0)) > 1))
      wrong.push(`${String(x)}, ${String(y)}: ${String(want)} is ${String([...got.subarray(4 * at, 4 * at + 3)])}`);
  }
  expect(wrong.slice(0, 5)).toEqual([]);
  expect(compared).toBeGreaterThan(50_000);
});

test("a highlight changes exactly the pixels of its ids", async () => {
  const { page } = await started({ zoom: 3 });
  const before = await pixels(page);
  await settled(page, (ids) => (globalThis as Global).layer.highlight(ids, { color: "#1389a0" }), [1025, 3_900_000_007]);
  const after = await pixels(page);
  await page.screenshot({ path: `${OUT}/highlight.png` });
  const ids = decodedLevel(town, "id");
  const [left, top] = await placeOf(page);
  const wrong: string[] = [];
  let changed = 0;
  for (let at = 0; at < 800 * 600; at++) {
    const id = ids((at % 800) - left, Math.floor(at / 800) - top)?.readUInt32LE() ?? 0;
    const differs = !before.subarray(4 * at, 4 * at + 4).equals(after.subarray(4 * at, 4 * at + 4));
    if (differs !== (id === 1025 || id === 3_900_000_007))
      wrong.push(`${String(at % 800)}, ${String(Math.floor(at / 800))} of object ${String(id)}`);
    if (differs) changed++;
  }
  expect(wrong.slice(0, 10)).toEqual([]);
  expect(changed).toBeGreaterThan(1000);
  await settled(page, () => (globalThis as Global).layer.clearHighlight(), null);
  expect(before.equals(await pixels(page))).toBe(true);
});

test("random data tiles arrive bit for bit", async () => {
  const noise = renderNoise(7);
  bed.server.renderings.set("noise", noise);
  const { page } = await recorded({ hover: true }, "noise");
  const got = await page.evaluate(async () => {
    const { layer } = globalThis as Global;
    const [view, store] = [layer.rendering?.views.get("0-45"), layer.tiles];
    const values = async (kind: string): Promise<number[]> => {
      const info = layer.rendering?.layers.get(kind);
      if (!view || !store || !info) throw new Error("not ready");
      const data = await store.fetch(view, info, { z: 0, x: 0, y: 0 });
      return data && "values" in data ? [...data.values] : [];
    };
    return { ids: await values("id"), depths: await values("depth") };
  });
  expect(got.ids.length).toBe(64 * 64);
  expect(got.ids.findIndex((id, k) => id !== noise.ids[k])).toBe(-1);
  expect(got.depths.findIndex((depth, k) => depth !== noise.depths[k])).toBe(-1);
});

test("random ids are exact on the GPU: highlighting a hundred changes a hundred texels", async () => {
  const noise = renderNoise(9);
  bed.server.renderings.set("noise2", noise);
  const { page } = await started({ zoom: 2 }, "noise2");
  const before = await pixels(page);
  const chosen = [...new Set(noise.ids)].filter((id) => id > 0).slice(200, 300);
  await settled(page, (ids) => (globalThis as Global).layer.highlight(ids), chosen);
  const after = await pixels(page);
  let changed = 0;
  for (let at = 0; at < 800 * 600; at++) if (before.readUInt32LE(4 * at) !== after.readUInt32LE(4 * at)) changed++;
  expect(changed).toBe(16 * noise.ids.filter((id) => chosen.includes(id)).length);
});

test("idle means no requests and no frames", async () => {
  const { page } = await recorded();
  await page.waitForTimeout(300);
  const asked = bed.server.requests.length;
  const frames = await page.evaluate(
    () =>
      new Promise<number>((done) => {
        let count = 0;
        const request = globalThis.requestAnimationFrame.bind(globalThis);
        globalThis.requestAnimationFrame = (call) => {
          count++;
          return request(call);
        };
        setTimeout(() => {
          done(count);
        }, 1000);
      }),
  );
  expect(frames).toBe(0);
  expect(bed.server.requests.length).toBe(asked);
});

test("only occupied tiles are requested, with the version of their block", async () => {
  bed.server.requests.length = 0;
  await recorded({ zoom: 3 });
  const tiles = bed.server.requests.filter((url) => url.startsWith("/tiles/town/0-45/"));
  expect(tiles.length).toBeGreaterThan(10);
  for (const url of tiles) {
    expect(url).toMatch(/\?v=7$/);
    expect(town.files.has(url.replace("/tiles/town/", "").replace(/\?.*/, "")), url).toBe(true);
  }
  expect(new Set(tiles).size).toBe(tiles.length);
});

test("a change of view keeps the point at the centre and the highlights", async () => {
  const { page } = await recorded({ zoom: 3, hover: true });
  const kept = await page.evaluate(async () => {
    const { map, layer } = globalThis as Global;
    layer.highlight(17);
    map.setView([691000 - 45, 5336000 - 4, 534], 3);
    await new Promise((done) => map.once("idle", done));
    const before = await map.pick([400, 300]);
    map.setDirection("90-45");
    const [x, y] = map.project(before.position as [number, number, number]) as [number, number];
    await new Promise((done) => map.once("idle", done));
    const after = await map.pick([400, 300]);
    return { before, after, x, y, highlighted: layer.highlighted, direction: map.direction };
  });
  await page.screenshot({ path: `${OUT}/turned.png` });
  // The pick has loaded the depth at the centre, so the roof itself stays there.
  expect(kept.direction).toBe("90-45");
  expect(kept.highlighted).toEqual([17]);
  expect(Math.hypot(kept.x - 400, kept.y - 300)).toBeLessThan(1.5);
  expect(kept.after.id).toBe(17);
});

test("a server that fails for a while delays tiles but loses none", async () => {
  bed.server.failures.set("/tiles/town/0-45/normal", 6);
  const { page } = await recorded();
  expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([]);
  expect(bed.server.failures.get("/tiles/town/0-45/normal")).toBe(0);
});

test("a restored WebGL context shows the same picture", async () => {
  const { page } = await started();
  const before = await pixels(page);
  await page.evaluate(async () => {
    const { map } = globalThis as Global;
    const extension = map.canvas.getContext("webgl2")?.getExtension("WEBGL_lose_context");
    const lost = new Promise((done) => map.once("contextlost", done));
    extension?.loseContext();
    await lost;
    await new Promise((done) => setTimeout(done, 50));
    const back = new Promise((done) => map.once("contextrestored", done));
    extension?.restoreContext();
    await back;
    await new Promise((done) => map.once("idle", done));
  });
  expect(before.equals(await pixels(page))).toBe(true);
});

test("dragging moves the ground with the pointer; the wheel zooms about it", async () => {
  const { page } = await recorded();
  const ground: [number, number, number] = [ORIGIN[0], ORIGIN[1], ORIGIN[2]];
  const at = (): Promise<[number, number]> =>
    page.evaluate((world) => (globalThis as Global).map.project(world) as [number, number], ground);
  const start = await at();
  await page.mouse.move(...start);
  await page.mouse.down();
  await page.mouse.move(start[0] + 40, start[1] - 30, { steps: 4 });
  await page.waitForTimeout(150);
  await page.mouse.up();
  const moved = await at();
  expect(moved[0] - start[0]).toBeCloseTo(40, 0);
  expect(moved[1] - start[1]).toBeCloseTo(-30, 0);
  const zoom = await page.evaluate(() => (globalThis as Global).map.zoom);
  await page.mouse.wheel(0, -200);
  await page.waitForFunction((least) => (globalThis as Global).map.zoom > least, zoom + 0.7);
  const zoomed = await at();
  expect(await page.evaluate(() => (globalThis as Global).map.zoom)).toBeGreaterThan(zoom + 0.5);
  expect(Math.hypot(zoomed[0] - moved[0], zoomed[1] - moved[1])).toBeLessThan(1);
});

test("without WebGL2 the map reports it in an event and in the page", async () => {
  const { page } = await bed.bare();
  const message = await page.evaluate(
    () =>
      new Promise<string>((done) => {
        HTMLCanvasElement.prototype.getContext = () => null;
        new (globalThis as Global).map3d.map("mapcanvas").on("error", ({ error }) => {
          done(error.message);
        });
      }),
  );
  expect(message).toContain("WebGL2");
  expect(await page.locator(".map3d-message").textContent()).toContain("WebGL2");
});

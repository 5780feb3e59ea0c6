import { expect, test } from "vitest";
import { published } from "../fixture/folder";
import { renderRamp, renderTown, type Fixture } from "../fixture/rendering";
import { encodePng } from "../fixture/encodePng";
import { ORIGIN } from "../fixture/town";
import { serve, TestBed } from "./testBed";
import { OUT } from "./browser";
import { pixels, settled, type Global } from "./page";

interface Addable {
  addTo(map: Global["map"]): unknown;
}
const town = renderTown(64, 0.76);

const drawn = new TestBed({ town, ramp: renderRamp(), published: published(town) });
const bed = new TestBed(drawn.server, { draws: false });
const other = serve({ town });

test.each([
  [4, 2.4],
  [3.37, 3.4],
  [2.5, 6.2],
])("at zoom %d no seam is visible between tiles", async (zoom, most) => {
  const { page } = await drawn.start("ramp", { zoom, light: { lit: false } });
  const got = await pixels(page);
  let steepest = 0;
  for (let y = 60; y < 540; y++) {
    for (let x = 160; x < 639; x++) {
      const at = 4 * (800 * y + x);
      steepest = Math.max(steepest, Math.abs((got[at] ?? 0) - (got[at + 4] ?? 0)), Math.abs((got[at] ?? 0) - (got[at + 3200] ?? 0)));
      if (got[at + 3] !== 255) throw new Error(`a hole at ${String(x)}, ${String(y)}`);
    }
  }
  expect(steepest).toBeGreaterThan(0.5);
  expect(steepest).toBeLessThanOrEqual(Math.ceil(most));
});

test("requests are spread over the hosts, and each tile always has the same host", async () => {
  const second = other.origin;
  [bed.server, other].forEach((each) => (each.requests.length = 0));
  await bed.start([bed.url("town"), `${second}/tiles/town`], { zoom: 3 });
  const [mine, theirs] = [bed.server, other].map((each) => new Set(each.requests.filter((url) => /\/tiles\/town\/\d/.test(url))));
  expect(mine?.size).toBeGreaterThan(4);
  expect(theirs?.size).toBeGreaterThan(4);
  expect([...(mine ?? [])].filter((url) => theirs?.has(url))).toEqual([]);
});

test("a published folder is read from its archives by byte ranges", async () => {
  bed.server.requests.length = 0;
  const { page } = await drawn.start("published", { zoom: 3 });
  const asked = bed.server.requests.filter((url) => url.startsWith("/tiles/published/"));
  expect(asked.filter((url) => url.endsWith(".pmtiles")).length).toBeGreaterThan(10);
  expect(asked.filter((url) => !/pmtiles$|rendering\.json$/.test(url))).toEqual([]);
  const fromArchive = await pixels(page);
  const { page: plain } = await drawn.start("town", { zoom: 3 });
  expect(fromArchive.equals(await pixels(plain))).toBe(true);
});

test("keys pan, zoom and rotate while the map has the focus", async () => {
  const { page } = await bed.start("town", { zoom: 3.8 });
  const state = (): Promise<{ zoom: number; direction: string; x: number }> =>
    page.evaluate(
      (world) => {
        const { map } = globalThis as Global;
        return { zoom: map.zoom, direction: map.direction, x: map.project(world)?.[0] ?? NaN };
      },
      ORIGIN as [number, number, number],
    );
  const first = await state();
  await page.evaluate(() => {
    (globalThis as Global).map.container.focus();
  });
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction(([world, x]) => Math.abs(((globalThis as Global).map.project(world)?.[0] ?? 0) - x) < 1, [
    ORIGIN as [number, number, number],
    first.x - 90,
  ] as const);
  await page.keyboard.press("+");
  await page.waitForFunction((zoom) => (globalThis as Global).map.zoom > zoom + 0.95, first.zoom);
  await page.keyboard.press("q");
  await expect.poll(async () => (await state()).direction, { timeout: 20_000 }).toBe("90-45");
  await page.keyboard.press("e");
  await expect.poll(async () => (await state()).direction, { timeout: 20_000 }).toBe("0-45");
});

test("a double click zooms at the pointer; the buttons zoom and rotate", async () => {
  const { page } = await bed.start("town", { zoom: 3.8 });
  await page.mouse.dblclick(300, 300);
  await page.waitForFunction(() => (globalThis as Global).map.zoom > 4.75);
  await page.getByRole("button", { name: "Zoom out" }).click();
  await page.waitForFunction(() => (globalThis as Global).map.zoom < 3.85);
  await page.getByRole("button", { name: "Turn view clockwise", exact: true }).click();
  await page.waitForFunction(() => (globalThis as Global).map.direction === "270-45");
  await page.getByRole("button", { name: /reset to north/ }).click();
  await page.waitForFunction(() => (globalThis as Global).map.direction === "0-45");
});

test("two fingers zoom about the point between them", async () => {
  const { page } = await bed.start("town", { zoom: 3.8 });
  const session = await page.context().newCDPSession(page);
  const ground = await page.evaluate(() => (globalThis as Global).map.unproject([400, 300]) as [number, number, number]);
  const touch = (type: "touchStart" | "touchMove" | "touchEnd", apart: number): Promise<unknown> =>
    session.send("Input.dispatchTouchEvent", {
      type,
      touchPoints:
        type === "touchEnd"
          ? []
          : [
              { x: 400 - apart, y: 300, id: 1 },
              { x: 400 + apart, y: 300, id: 2 },
            ],
    });
  await touch("touchStart", 50);
  for (let apart = 55; apart <= 100; apart += 5) await touch("touchMove", apart);
  await touch("touchEnd", 0);
  const after = await page.evaluate(
    (world) => ({ zoom: (globalThis as Global).map.zoom, at: (globalThis as Global).map.project(world) as [number, number] }),
    ground,
  );
  expect(after.zoom).toBeCloseTo(4.8, 1);
  expect(Math.hypot(after.at[0] - 400, after.at[1] - 300)).toBeLessThan(3);
});

test("hovering reports the object under the pointer", async () => {
  const { page } = await bed.start("town", { hover: true, zoom: 2 });
  const at = await page.evaluate(
    ([x, y, z]) => {
      const { map } = globalThis as Global;
      map.on("mousemove", ({ id }) => {
        (globalThis as Global & { under: number }).under = id;
      });
      return map.project([x - 45, y - 4, z + 34]) as [number, number];
    },
    ORIGIN as [number, number, number],
  );
  await page.mouse.move(...at);
  await page.waitForFunction(() => (globalThis as Global & { under: number }).under === 17);
});

test("the debug overlay labels tiles with their names and their layers' bytes and ages", async () => {
  const { page } = await bed.start("town", { zoom: 4 });
  await page.addScriptTag({ url: `${bed.server.origin}/map3d-debug.js` });
  await settled(
    page,
    () => {
      new (globalThis as Global & { map3d: { debugTiles: new () => Addable } }).map3d.debugTiles().addTo((globalThis as Global).map);
    },
    null,
  );
  await page.screenshot({ path: `${OUT}/debug.png` });
  expect(await page.locator(".map3d-debug > div").first().textContent()).toMatch(
    /^3\/\d\/\d × 2\.00\nnormal [1-9]*\d\.\d kB, \d s\ncolor [1-9]*\d\.\d kB, \d s$/,
  );
  expect(await page.locator(".map3d-debug > div").allTextContents()).not.toEqual(
    expect.arrayContaining([expect.stringMatching(/ 0\.0 kB/)]),
  );
});

test("a removed map restores the canvas, requests nothing, and can be replaced by another", async () => {
  const { page, problems } = await bed.start("town");
  const left = await page.evaluate(async (base) => {
    const g = globalThis as Global;
    g.map.remove();
    const bare =
      document.body.innerHTML.includes("map3d-controls") || document.querySelector("#mapcanvas")?.parentElement !== document.body;
    const next = new g.map3d.map("mapcanvas");
    new g.map3d.imageLayer(base).addTo(next);
    await new Promise((done) => next.once("load", done));
    return bare;
  }, bed.url("town"));
  expect(left).toBe(false);
  expect(problems).toEqual([]);
});

test("the canvas resizes with the window", async () => {
  const { page } = await bed.start("town");
  await page.setViewportSize({ width: 500, height: 700 });
  await page.waitForFunction(() => (globalThis as Global).map.canvas.width === 500 && (globalThis as Global).map.canvas.height === 700);
});

test("a manifest of another version is refused with both version numbers", async () => {
  bed.server.renderings.set("new", { ...town, json: { ...town.json, version: 9 } });
  const { page } = await bed.bare();
  const message = await page.evaluate(
    (base) =>
      new Promise<string>((done) => {
        const { map3d } = globalThis as Global;
        const map = new map3d.map("mapcanvas");
        map.on("error", ({ error }) => {
          done(error.message);
        });
        new map3d.imageLayer(base).addTo(map);
      }),
    bed.url("new"),
  );
  expect(message).toMatch(/version 9.*version 1/);
});

test("the cache stays within its limit while the map moves", async () => {
  const { page } = await bed.start("town", { zoom: 3, cacheBytes: 600_000 });
  const most = await page.evaluate(async () => {
    const { map } = globalThis as Global;
    let greatest = 0;
    for (const direction of ["90-45", "180-45", "270-45", "0-45"]) {
      map.setDirection(direction);
      await new Promise((done) => map.once("idle", done));
      greatest = Math.max(greatest, map.cacheBytes);
    }
    return greatest;
  });
  // Only tiles in view may exceed the limit.
  expect(most).toBeLessThan(600_000 + 64 * 64 * 7 * 80);
});

test("a view larger than the cache comes to rest and requests each tile once", async () => {
  const from = bed.server.requests.length;
  const { page } = await bed.start("town", { zoom: 3, cacheBytes: 1 });
  await settled(page, () => (globalThis as Global).map.setLight({ azimuth_deg: 12 }), null);
  const asked = bed.server.requests.slice(from).filter((url) => /\/(color|normal)\//.test(url));
  expect(asked.length).toBeGreaterThan(10);
  expect(new Set(asked).size).toBe(asked.length);
});

/** The town with some files replaced. */
function changed(name: string, change: (files: Map<string, Uint8Array>) => void, json: Partial<Fixture["json"]> = {}): string {
  const files = new Map(town.files);
  change(files);
  bed.server.renderings.set(name, { json: { ...town.json, ...json }, files, raw: town.raw });
  return name;
}

test("an error names a broken tile; the others are shown", async () => {
  const name = changed("broken", (files) => files.set("0-45/normal/3/3/4", new Uint8Array([1, 2, 3])));
  const { page } = await bed.start(name, { zoom: 3.5 });
  const errors = await page.evaluate(() => (globalThis as Global).errors);
  expect(errors.length).toBe(1);
  expect(errors[0]).toMatch(/tile 0-45\/normal\/3\/3\/4: not a PNG \(3 bytes\)/);
});

test("a pick is approximate if its deepest tile cannot be fetched", async () => {
  const name = changed("shallow", (files) => {
    for (const path of files.keys()) if (/\/(id|depth)\/3\//.test(path)) files.set(path, new Uint8Array([0]));
  });
  const { page } = await bed.start(name, { hover: true });
  const pick = await page.evaluate(
    async ([x, y, z]) => {
      const { map, layer } = globalThis as Global;
      const view = layer.rendering?.views.get("0-45");
      for (const kind of ["id", "depth"]) {
        const info = layer.rendering?.layers.get(kind);
        if (view && info) await layer.tiles?.fetch(view, info, { z: 0, x: 0, y: 0 });
      }
      const { id, position, approximate } = await map.pick(map.project([x - 45, y - 4, z + 34]) as [number, number]);
      return { id, position, approximate };
    },
    ORIGIN as [number, number, number],
  );
  expect(pick).toMatchObject({ id: 17, approximate: true });
  const level0_m = (0.76 * 8) / 2;
  expect(
    Math.hypot(...(pick.position ?? [0, 0, 0]).map((part, k) => part - ([ORIGIN[0] - 45, ORIGIN[1] - 4, ORIGIN[2] + 34][k] ?? 0))),
  ).toBeLessThan(4 * level0_m);
});

test("if colour has no alpha, the id layer tells covered pixels", async () => {
  const layers = town.json.layers.map((layer) => (layer.kind === "color" ? { ...layer, format: "jpeg" } : layer));
  const name = changed(
    "opaque",
    (files) => {
      for (const [path, bytes] of town.raw) {
        if (path.includes("/color/"))
          files.set(
            path,
            encodePng(
              64,
              64,
              4,
              bytes.map((value, at) => (at % 4 === 3 ? 255 : value)),
            ),
          );
      }
    },
    { layers },
  );
  const { page } = await drawn.start(name, { zoom: 3.5 });
  const got = await pixels(page);
  const { page: plain } = await drawn.start("town", { zoom: 3.5 });
  const want = await pixels(plain);
  const alphas = (bytes: Buffer): number => bytes.filter((value, at) => at % 4 === 3 && value > 127).length;
  expect(alphas(got)).toBeGreaterThan(10_000);
  expect(alphas(got)).toBeLessThan(470_000);
  expect(Math.abs(alphas(got) - alphas(want)) / alphas(want)).toBeLessThan(0.01);
});

test("markers can be focused and selected by keys, one at a time", async () => {
  const { page } = await bed.start("town", { controls: false });
  await page.evaluate(
    ([x, y, z]) => {
      const { map, map3d } = globalThis as Global;
      const told: string[] = [];
      for (const name of ["a", "b"])
        new map3d.marker(name, [x, y + told.length, z])
          .bindPopup(`about ${name}`)
          .on("click", ({ marker }) => told.push(`click ${marker.label}`))
          .addTo(map);
      map.on("select", ({ marker }) => told.push(`select ${marker.label}`));
      Object.assign(globalThis, { told });
      map.container.focus();
    },
    ORIGIN as [number, number, number],
  );
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  expect(await page.evaluate(() => (globalThis as unknown as { told: string[] }).told)).toEqual([
    "click a",
    "select a",
    "click b",
    "select b",
  ]);
  expect(await page.locator(".map3d-marker-selected").count()).toBe(1);
  expect(await page.locator(".map3d-popup-body").allTextContents()).toEqual(["about a", "about b"]);
});

test("a drag that ends in motion continues with inertia and comes to rest", async () => {
  const { page } = await bed.start("town", { zoom: 4.5 });
  const at = (): Promise<number> =>
    page.evaluate((world) => (globalThis as Global).map.project(world)?.[0] ?? 0, ORIGIN as [number, number, number]);
  await page.evaluate(() => {
    const { map } = globalThis as Global;
    const point = (type: string, x: number): void =>
      void map.canvas.dispatchEvent(
        new PointerEvent(type, { pointerId: 1, pointerType: "touch", clientX: x, clientY: 300, bubbles: true }),
      );
    map.canvas.setPointerCapture = () => undefined;
    return new Promise<void>((done) => {
      point("pointerdown", 300);
      let x = 300;
      const timer = setInterval(() => {
        point("pointermove", (x += 8));
        if (x < 380) return;
        clearInterval(timer);
        point("pointerup", x);
        map.once("moveend", () => {
          done();
        });
      }, 8);
    });
  });
  const end = await at();
  await page.waitForTimeout(100);
  expect(await at()).toBe(end);
  expect(end - 400).toBeGreaterThan(85);
});

test("objects in view are those with ids on the screen, sorted by area", async () => {
  const { page } = await drawn.start("town");
  const whole = await page.evaluate(async () => (await (globalThis as Global).map.objectsInView()).map(({ id, share }) => ({ id, share })));
  expect(whole.map(({ id }) => id).sort((a, b) => a - b)).toEqual([3, 17, 1025, 2_000_000_001, 3_900_000_007]);
  expect(whole[0]?.id).toBe(3);
  const covered = whole.reduce((sum, { share }) => sum + share, 0);
  const bytes = await pixels(page);
  const painted = bytes.filter((value, k) => k % 4 === 3 && value > 127).length / (bytes.length / 4);
  expect(painted).toBeGreaterThan(0.1);
  expect(Math.abs(covered / painted - 1)).toBeLessThan(0.02);
  await settled(page, () => (globalThis as Global).map.setView([691_000 + 32, 5_336_000 + 26, 500 + 62], 6), null);
  const near = await page.evaluate(async () => (await (globalThis as Global).map.objectsInView()).map(({ id }) => id));
  expect([...near].sort((a, b) => a - b)).toEqual([3, 17, 2_000_000_001, 3_900_000_007]);
});

test("calls before the manifest that fail are reported, and the others run", async () => {
  const { page } = await bed.bare();
  const said = await page.evaluate(
    (url) =>
      new Promise<[string[], string]>((done) => {
        const g = globalThis as Global;
        const errors: string[] = [];
        const view = new g.map3d.map("mapcanvas").setDirection("5-5").setDirection("90-45");
        view
          .on("error", ({ error }) => errors.push(error.message))
          .once("idle", () => {
            done([errors, view.direction]);
          });
        new g.map3d.imageLayer(url).addTo(view);
      }),
    bed.url("town"),
  );
  expect(said[0]).toHaveLength(1);
  expect(said[0][0]).toMatch(/^unknown view "5-5"; the rendering has 0-45, /);
  expect(said[1]).toBe("90-45");
});

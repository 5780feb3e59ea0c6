import { describe, expect, test } from "vitest";
import type { Page } from "playwright-core";
import { encodePng } from "../fixture/encodePng";
import { renderRamp, renderTown, type Fixture } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { picture, settled, type Global } from "./page";

const town = renderTown();
const VIEWPORT = { width: 500, height: 400 };

const bed = new TestBed({ town, ramp: renderRamp(), opaque: opaque(town), broken: broken(town) });

/** The town with colour without alpha, like JPEG. */
function opaque({ json, files, raw }: Fixture): Fixture {
  const layers = json.layers.map((layer) => (layer.kind === "color" ? { ...layer, format: "jpeg" } : layer));
  const filled = [...raw]
    .filter(([path]) => path.includes("/color/"))
    .map(
      ([path, bytes]) =>
        [
          path,
          encodePng(
            128,
            128,
            4,
            bytes.map((value, at) => (at % 4 === 3 ? 255 : value)),
          ),
        ] as const,
    );
  return { json: { ...json, layers }, files: new Map([...files, ...filled]), raw };
}

/** The town without some tiles: level 2 and the left half of level 3 cannot be read. */
function broken({ json, files, raw }: Fixture): Fixture {
  const bad = [...files.keys()].filter((path) => /\/(2\/\d+\/\d+|3\/[0-3]\/\d+)$/.test(path));
  return { json, files: new Map([...files, ...bad.map((path) => [path, new Uint8Array([0])] as const)]), raw };
}

interface Difference {
  /** Largest difference of premultiplied bytes. */
  readonly most: number;
  /** Fraction of bytes that differ by more than 2. */
  readonly off: number;
}

function differenceOf(a: Buffer, b: Buffer): Difference {
  expect(a.length).toBe(b.length);
  let [most, off] = [0, 0];
  for (let k = 0; k < a.length; k++) {
    const byte = (from: Buffer): number => (k % 4 === 3 ? (from[k] ?? 0) : ((from[k] ?? 0) * (from[k | 3] ?? 0)) / 255);
    const apart = Math.abs(byte(a) - byte(b));
    most = Math.max(most, apart);
    if (apart > 2) off++;
  }
  return { most, off: off / a.length };
}

/** The same scene in both drawers. */
async function both(name: string, options: object = {}, layer: object = {}, deviceScaleFactor = 1): Promise<Page[]> {
  const pages: Page[] = [];
  for (const drawer of ["webgl", "canvas"]) {
    const { page, problems } = await bed.start(name, { zoom: 3, drawer, maxPixelRatio: deviceScaleFactor, ...options }, layer, {
      deviceScaleFactor,
      viewport: VIEWPORT,
    });
    expect(problems).toEqual([]);
    expect(await page.evaluate(() => (globalThis as Global).map.drawer)).toBe(drawer);
    pages.push(page);
  }
  return pages;
}

/** Runs a function on both pages and compares their pictures. */
async function compared<A>(pages: readonly Page[], act: (argument: A) => unknown, argument: A): Promise<Difference> {
  const shots: Buffer[] = [];
  for (const page of pages) {
    await settled(page, act, argument);
    shots.push(await picture(page));
  }
  return differenceOf(shots[0] as Buffer, shots[1] as Buffer);
}

const setMode = (mode: string): unknown => (globalThis as Global).layer.setMode(mode as "lit");
const setZoom = (zoom: number): unknown => (globalThis as Global).map.setZoom(zoom);
const MODES = ["color", "normal", "id", "depth", "lit"];
const CHOSEN = [17, 1025, 3_900_000_007];

describe("if a tile pixel is a device pixel, both drawers agree except for rounding", () => {
  test.each([1, 2])("in every mode, with and without highlights, at pixel ratio %i", async (dpr) => {
    const pages = await both("town", { zoom: dpr === 1 ? 3 : 2 }, {}, dpr);
    for (const mode of MODES) expect((await compared(pages, setMode, mode)).most, mode).toBeLessThanOrEqual(1.01);
    await settledAll(pages, () => (globalThis as Global).layer.highlight([17, 1025], { color: "#1389a0" }).highlight(3_900_000_007));
    for (const mode of MODES) expect((await compared(pages, setMode, mode)).most, `${mode} with highlights`).toBeLessThanOrEqual(1.01);
    await pages[1]?.screenshot({ path: `${OUT}/canvas-highlight-${String(dpr)}.png` });
  });

  test("with another light, and without light", async () => {
    const pages = await both("town");
    for (const light of [
      { azimuth_deg: 20, elevation_deg: 10, ambient: 0.1, diffuse: 3 },
      { azimuth_deg: 200, diffuse: 0 },
      { lit: false },
    ]) {
      expect((await compared(pages, (given) => (globalThis as Global).map.setLight(given), light)).most).toBeLessThanOrEqual(1.01);
    }
  });

  test("if the id layer tells covered pixels", async () => {
    const pages = await both("opaque");
    for (const mode of ["color", "lit"]) expect((await compared(pages, setMode, mode)).most).toBeLessThanOrEqual(1.01);
    expect((await compared(pages, (ids) => (globalThis as Global).layer.highlight(ids), CHOSEN)).most).toBeLessThanOrEqual(1.01);
  });

  test("with a translucent second layer", async () => {
    const pages = await both("town");
    const add = (url: string): unknown =>
      new (globalThis as Global).map3d.imageLayer(url, { mode: "id", opacity: 0.4 }).addTo((globalThis as Global).map);
    expect((await compared(pages, add, bed.url("opaque"))).most).toBeLessThanOrEqual(2.01);
    await pages[1]?.screenshot({ path: `${OUT}/canvas-layers.png` });
  });
});

async function settledAll(pages: readonly Page[], act: () => unknown): Promise<void> {
  for (const page of pages) await settled(page, act, null);
}

/** The canvas drawer interpolates sRGB and the WebGL drawer linear light, so edges between dark and bright differ; false colours are not interpolated. */
describe("at fractional zooms", () => {
  test.each([1, 2, 3])("both drawers agree except for edges at pixel ratio %i", async (dpr) => {
    const pages = await both("town", {}, {}, dpr);
    for (const mode of ["lit", "id"]) {
      await settledAll(
        pages,
        mode === "lit" ? () => (globalThis as Global).layer.setMode("lit") : () => (globalThis as Global).layer.setMode("id"),
      );
      for (const zoom of dpr === 3 ? [2.6] : [1.8, 2.6, 3.45, 4.7]) {
        const { most, off } = await compared(pages, setZoom, zoom);
        expect(off, `${mode} at ${String(zoom)}`).toBeLessThan(mode === "lit" ? 0.03 : 0.002);
        if (mode === "lit") expect(most).toBeLessThan(30);
      }
    }
    await pages[1]?.screenshot({ path: `${OUT}/canvas-between-${String(dpr)}.png` });
  });

  test.each([
    [4, 1, 2.4],
    [3.37, 1, 3.4],
    [2.5, 1, 6.2],
    [2.71, 2, 4],
    [3.9, 3, 2],
  ])("at zoom %d and pixel ratio %i no seam is visible between tiles", async (zoom, dpr, most) => {
    const { page } = await bed.start(
      "ramp",
      { zoom, light: { lit: false }, drawer: "canvas", maxPixelRatio: dpr },
      {},
      { deviceScaleFactor: dpr },
    );
    const got = await picture(page);
    const width = 800 * dpr;
    let steepest = 0;
    for (let y = 60 * dpr; y < 540 * dpr; y++) {
      for (let x = 160 * dpr; x < 639 * dpr; x++) {
        const at = 4 * (width * y + x);
        steepest = Math.max(steepest, Math.abs((got[at] ?? 0) - (got[at + 4] ?? 0)), Math.abs((got[at] ?? 0) - (got[at + 4 * width] ?? 0)));
        if (got[at + 3] !== 255) throw new Error(`a hole at ${String(x)}, ${String(y)}`);
      }
    }
    expect(steepest).toBeGreaterThan(0.5);
    expect(steepest).toBeLessThanOrEqual(Math.ceil(most));
  });
});

test("ancestors and descendants replace tiles that cannot be fetched", async () => {
  const pages = await both("broken", {}, { mode: "id" });
  expect((await compared(pages, setMode, "depth")).most).toBeLessThanOrEqual(1.01);
  expect((await compared(pages, setMode, "lit")).off).toBeLessThan(0.03);
  await pages[1]?.screenshot({ path: `${OUT}/canvas-stand-ins.png` });
  expect((await compared(pages, setZoom, 2)).off).toBeLessThan(0.02);
});

describe("the drawer", () => {
  const withoutWebGL = (): void => {
    const original = Object.getOwnPropertyDescriptor(HTMLCanvasElement.prototype, "getContext")?.value as (
      this: HTMLCanvasElement,
      kind: string,
      ...rest: unknown[]
    ) => null;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, ...rest: unknown[]): null {
      return kind === "webgl2" ? null : original.call(this, kind, ...rest);
    };
  };

  /** Imitates browsers whose WebGL runs on the CPU. */
  const slowly = (): void => {
    const original = Object.getOwnPropertyDescriptor(HTMLCanvasElement.prototype, "getContext")?.value as (
      this: HTMLCanvasElement,
      kind: string,
      options?: object,
    ) => null;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, options?: WebGLContextAttributes): null {
      return options?.failIfMajorPerformanceCaveat === true ? null : original.call(this, kind, options);
    };
  };

  const named = (): void => {
    WebGL2RenderingContext.prototype.getParameter = () =>
      "ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (LLVM 10.0.0)), SwiftShader driver)";
  };

  test.each([
    ["auto", "without WebGL2", withoutWebGL, "canvas", /^$/],
    ["webgl", "without WebGL2", withoutWebGL, null, /does not support WebGL2/],
    ["auto", "where WebGL2 is slow", slowly, "canvas", /^$/],
    ["webgl", "where WebGL2 is slow", slowly, "webgl", /^$/],
    ["auto", "where the processor draws WebGL2, by its name", named, "canvas", /^$/],
    ["auto", "where WebGL2 is quick", (): void => undefined, "webgl", /^$/],
  ])("%s %s", async (drawer, _, script, name, message) => {
    const { page } = await bed.openPage();
    await page.addInitScript(script);
    await page.goto(`${bed.server.origin}/bare`);
    const got = await page.evaluate(
      ([base, drawer]) =>
        new Promise<{ name: string | null; message: string }>((done) => {
          const g = globalThis as Global;
          const map = new g.map3d.map("mapcanvas", { drawer: drawer as "auto" });
          const layer = new g.map3d.imageLayer(base).addTo(map);
          map
            .once("idle", () => {
              done({ name: map.drawer, message: "" });
            })
            .on("error", ({ error }) => {
              done({ name: map.drawer, message: error.message });
            });
          return layer;
        }),
      [bed.url("town"), drawer] as const,
    );
    expect(got.name).toBe(name);
    expect(got.message).toMatch(message);
  });

  test("a canvas without WebGL replaces a context that is lost for good; gestures still move the map", async () => {
    const { page, problems } = await bed.start("town", { zoom: 3 });
    const before = await picture(page);
    const told = await page.evaluate(async () => {
      const { map } = globalThis as Global;
      const [told, old] = [[] as string[], map.canvas];
      map.on("contextlost", () => told.push("lost")).on("contextrestored", () => told.push("restored"));
      const back = new Promise((done) => map.once("contextrestored", done));
      old.getContext("webgl2")?.getExtension("WEBGL_lose_context")?.loseContext();
      await back;
      await new Promise((done) => map.once("idle", done));
      return [...told, map.drawer, String(map.canvas === old), map.canvas.id, String(document.querySelectorAll("canvas").length)];
    });
    expect(told).toEqual(["lost", "restored", "canvas", "false", "mapcanvas", "1"]);
    expect(differenceOf(before, await picture(page)).most).toBeLessThanOrEqual(1.01);
    await page.mouse.move(400, 300);
    await page.mouse.down();
    await page.mouse.move(450, 300, { steps: 4 });
    await page.waitForTimeout(150);
    await page.mouse.up();
    await page.evaluate(() => new Promise((done) => (globalThis as Global).map.once("idle", done).setLight({})));
    expect(differenceOf(before, await picture(page)).off).toBeGreaterThan(0.01);
    expect(
      await page.evaluate(() => {
        (globalThis as Global).map.remove();
        return document.querySelector("#mapcanvas")?.parentElement === document.body;
      }),
    ).toBe(true);
    expect(problems.filter((text) => !/WebGL|CONTEXT_LOST/i.test(text))).toEqual([]);
  });
});

test("picks are exact", async () => {
  const { page } = await bed.start("town", { drawer: "canvas" });
  const roof: [number, number, number] = [ORIGIN[0] - 45, ORIGIN[1] - 4, ORIGIN[2] + 34];
  const pick = await page.evaluate(async (world) => {
    const { map } = globalThis as Global;
    const { id, position, approximate } = await map.pick(map.project(world) as [number, number]);
    return { id, position, approximate };
  }, roof);
  expect(pick).toMatchObject({ id: 17, approximate: false });
  expect(pick.position?.[2]).toBeCloseTo(roof[2], 2);
});

test("an idle map draws no frames and sends no messages to workers", async () => {
  const { page } = await bed.start("town", { drawer: "canvas", dataSaver: true });
  const counts = await page.evaluate(
    () =>
      new Promise<{ resting: number; moving: number }>((done) => {
        let count = 0;
        const [request, post] = [
          globalThis.requestAnimationFrame.bind(globalThis),
          Object.getOwnPropertyDescriptor(Worker.prototype, "postMessage")?.value as Worker["postMessage"],
        ];
        globalThis.requestAnimationFrame = (call) => {
          count++;
          return request(call);
        };
        Worker.prototype.postMessage = function (this: Worker, ...given: unknown[]): void {
          count++;
          post.apply(this, given as Parameters<typeof post>);
        };
        setTimeout(() => {
          const resting = count;
          const { map } = globalThis as Global;
          map
            .once("idle", () => {
              done({ resting, moving: count });
            })
            .setLight({ azimuth_deg: 10 });
        }, 1000);
      }),
  );
  expect(counts.resting).toBe(0);
  expect(counts.moving).toBeGreaterThan(4);
});

test("the old picture stays while new light is computed", async () => {
  const { page } = await bed.start("town", { drawer: "canvas" });
  const least = await page.evaluate(
    () =>
      new Promise<number>((done) => {
        const { map } = globalThis as Global;
        const copy = new OffscreenCanvas(80, 60).getContext("2d", { willReadFrequently: true }) as OffscreenCanvasRenderingContext2D;
        let least = Infinity;
        const look = (): void => {
          copy.clearRect(0, 0, 80, 60);
          copy.drawImage(map.canvas, 0, 0, 80, 60);
          least = Math.min(least, copy.getImageData(0, 0, 80, 60).data.filter((value, k) => k % 4 === 3 && value > 0).length);
          requestAnimationFrame(look);
        };
        look();
        const full = least;
        map.once("idle", () => {
          done(least / full);
        });
        for (let k = 1; k < 12; k++) setTimeout(() => map.setLight({ azimuth_deg: 30 * k }), 30 * k);
      }),
  );
  expect(least).toBe(1);
});

test("if pixels cannot be read exactly, compositing lights nearly the same", async () => {
  const options = { zoom: 3, light: { azimuth_deg: 215, elevation_deg: 48, ambient: 0.42, diffuse: 0.9 } };
  const { page: plain } = await bed.start("town", { ...options, drawer: "webgl" });
  const { page } = await bed.openPage();
  await page.addInitScript(() => {
    const spoil =
      "{ const read = OffscreenCanvasRenderingContext2D.prototype.getImageData; OffscreenCanvasRenderingContext2D.prototype.getImageData = function (...at) { const image = read.apply(this, at); for (let k = 0; k < image.data.length; k++) image.data[k] ^= 7 * (k & 1); return image; }; }";
    const Plain = Blob;
    globalThis.Blob = class extends Plain {
      constructor(parts: BlobPart[] = [], options?: BlobPropertyBag) {
        super(options?.type === "text/javascript" ? [spoil, ...parts] : parts, options);
      }
    };
  });
  await page.goto(`${bed.server.origin}/bare`);
  await page.evaluate(
    ([base, options]) =>
      new Promise<void>((done) => {
        const g = globalThis as Global;
        g.map = new g.map3d.map("mapcanvas", { ...options, drawer: "canvas", preserveDrawingBuffer: true });
        g.layer = new g.map3d.imageLayer(base).addTo(g.map);
        g.map.once("idle", () => {
          done();
        });
      }),
    [bed.url("town"), options] as const,
  );
  const lit = differenceOf(await picture(plain), await picture(page));
  await page.screenshot({ path: `${OUT}/canvas-composed.png` });
  expect(lit.most).toBeLessThan(4); // altered bytes, once read, would differ by more
  for (const each of [plain, page]) await settled(each, (ids) => (globalThis as Global).layer.highlight(ids), CHOSEN);
  await page.screenshot({ path: `${OUT}/canvas-composed-highlight.png` });
  const shown = differenceOf(await picture(plain), await picture(page));
  expect(shown.most).toBeGreaterThan(1.01); // pixels that are read exactly give no more
  expect(shown.most).toBeLessThan(30);
  for (const each of [plain, page]) await settled(each, setMode, "id");
  expect(differenceOf(await picture(plain), await picture(page)).most).toBeLessThanOrEqual(1.01);
});

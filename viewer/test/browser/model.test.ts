import type { Page } from "playwright-core";
import type * as THREE from "three";
import type { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { beforeAll, expect, test } from "vitest";
import type * as Model from "../../src/model";
import type * as Orbit from "../../src/orbit";
import type * as Shading from "../../src/shade";
import { dot, type Vec3 } from "../../src/core/vec";
import { computeAxes } from "../../src/geo/axes";
import { makeFrame } from "../../src/geo/frame";
import { DEFAULT_LIGHT, towardsLight, type Light } from "../../src/geo/light";
import { renderTown } from "../fixture/rendering";
import { threeScript, triangleGltf } from "../fixture/three";
import { ORIGIN, trace, type Hit, type Thing } from "../fixture/town";
import { TestBed } from "./testBed";
import { answered, OUT } from "./browser";
import { picture, settled, steady, type Global } from "./page";

const town = renderTown();
const bed = new TestBed({ town });
const [WIDE, HIGH] = [500, 420];
const VIEWPORT = { viewport: { width: WIDE, height: HIGH } };
const OPTIONS = { center: [ORIGIN[0] - 30, ORIGIN[1] + 10, ORIGIN[2] + 10], zoom: 3, direction: "0-45" };
type Modelling = Global & { map3d: typeof Model; THREE: typeof THREE; GLTFLoader: typeof GLTFLoader; model: Model.modelLayer<typeof THREE> };

/** A box of one colour behind the town hall, before the chapel. */
const WALL: Vec3 = [214, 196, 160];
const BOX: Thing = { id: 99, name: "Box", box: [[-48, 18, 0], [-10, 28, 24]], wall: WALL, roof: WALL };

beforeAll(async () => {
  bed.server.pages.set("/three.js", await threeScript()).set("/triangle.gltf", triangleGltf());
  bed.server.policies.set("/bare", "default-src 'none'; script-src 'self'; style-src 'self'; img-src blob: data:; connect-src * data:; worker-src blob:");
});

async function start(options: object = {}, context: object = {}): ReturnType<TestBed["start"]> {
  const opened = await bed.start("town", { ...OPTIONS, ...options }, {}, { ...VIEWPORT, ...context });
  await opened.page.addScriptTag({ url: "/three.js" });
  await opened.page.addScriptTag({ url: "/map3d-model.js" });
  return opened;
}

/** The box as a three.js mesh on the map, with more options of the layer. */
const addBox = (page: Page, options: object = {}): Promise<void> => settled(page, ([{ box, wall }, origin, more]: readonly [Thing, Vec3, object]) => {
  const g = globalThis as Modelling;
  const [w, d, h] = [0, 1, 2].map((k) => (box[1][k as 0] - box[0][k as 0])) as [number, number, number];
  const color = new g.THREE.Color().setRGB(wall[0] / 255, wall[1] / 255, wall[2] / 255, g.THREE.SRGBColorSpace);
  const mesh = new g.THREE.Mesh(new g.THREE.BoxGeometry(w, h, d), new g.THREE.MeshLambertMaterial({ color }));
  mesh.position.y = h / 2;
  const group = new g.THREE.Group().add(mesh);
  g.model = new g.map3d.modelLayer(g.THREE, group, { position: [origin[0] + box[0][0] + w / 2, origin[1] + box[0][1] + d / 2, origin[2] + box[0][2]], ...more }).addTo(g.map);
}, [BOX, ORIGIN, options] as const);

const frame = makeFrame(town.json.views[0] as (typeof town.json.views)[0], town.json.size_m, town.json.tile_px, town.json.zmax);

/** Finds what the ray through a pixel's centre hits in the town and on the box. */
async function raysOf(page: Page, dpr = 1): Promise<(x: number, y: number) => { town: Hit | null; box: Hit | null }> {
  const [[x0, y0], px] = await page.evaluate((origin) => [(globalThis as Global).map.project(origin) as [number, number], (globalThis as Global).map.metresPerPixel] as const, ORIGIN);
  return (x, y) => {
    const [u, v] = [((x + 0.5) / dpr - x0) * px, (y0 - (y + 0.5) / dpr) * px];
    return { town: trace(frame, u, v), box: trace(frame, u, v, [BOX]) };
  };
}

const linear = (byte: number): number => (byte / 255 <= 0.04045 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4);
const srgb = (value: number): number => 255 * (value <= 0.0031308 ? value * 12.92 : 1.055 * value ** (1 / 2.4) - 0.055);
const lambert = (color: Vec3, normal: Vec3, light: Light): number[] =>
  color.map((byte, k) => srgb(Math.min(1, linear(byte) * (light.ambient * (light.sky_rgb[k] ?? 0) + light.diffuse * (light.sun_rgb[k] ?? 0) * Math.max(0, dot(normal, towardsLight(light)))))));

const inTown = (x: number, y: number, z: number): Vec3 => [ORIGIN[0] + x, ORIGIN[1] + y, ORIGIN[2] + z];
const rgbAt = (shot: Buffer, x: number, y: number, wide = WIDE): number[] => [...shot.subarray(4 * (wide * y + x), 4 * (wide * y + x) + 3)];

/** Checks the pixels within `reach` of which only the same faces are visible: lists those that show the box wrongly, and counts them by kind. */
async function judged(page: Page, light: Light, { dpr = 1, reach = 1 } = {}): Promise<{ wrong: string[]; before: number; behind: number }> {
  const [shot, raysAt] = [await picture(page), await raysOf(page, dpr)];
  const [wrong, count]: [string[], { before: number; behind: number }] = [[], { before: 0, behind: 0 }];
  for (let y = 2; y < HIGH * dpr - 2; y += dpr) {
    for (let x = 2; x < WIDE * dpr - 2; x += dpr) {
      const here = raysAt(x, y);
      if (!here.box) continue;
      const kind = ({ town: a, box: b }: typeof here): string => `${String(a?.id)} ${String(a?.normal)} ${String(b?.normal)} ${String(b && (!a || b.d < a.d))}`;
      if ([raysAt(x - reach, y), raysAt(x + reach, y), raysAt(x, y - reach), raysAt(x, y + reach)].some((beside) => kind(beside) !== kind(here))) continue;
      const seen = !here.town || here.box.d < here.town.d;
      const want = lambert(WALL, here.box.normal, light);
      const got = rgbAt(shot, x, y, WIDE * dpr);
      const same = want.every((byte, k) => Math.abs(byte - (got[k] ?? 0)) <= 2);
      // The town hall's walls have the box's colour and face as its walls do: only windows and roof show what is hidden there.
      const alike = here.town && !seen && String(here.town.normal) === String(here.box.normal);
      if (!alike) count[seen ? "before" : "behind"]++;
      if (!alike && same !== seen) wrong.push(`${String(x)}, ${String(y)}: ${got.join(" ")} for ${want.map(Math.round).join(" ")}, ${seen ? "seen" : "hidden"}`);
    }
  }
  return { wrong, ...count };
}

test("a box is visible exactly where it is nearer than the images, with equal brightness; removing it restores the picture", async () => {
  const { page, problems } = await start();
  const before = await picture(page);
  await addBox(page);
  await page.screenshot({ path: `${OUT}/model-box.png` });
  const found = await judged(page, DEFAULT_LIGHT);
  expect(found.wrong.slice(0, 5)).toEqual([]);
  expect([found.before > 2500, found.behind > 800]).toEqual([true, true]);

  const evening: Light = { ...DEFAULT_LIGHT, azimuth_deg: 265, altitude_deg: 20, ambient: 0.3, diffuse: 0.9, sun_rgb: [1, 0.7, 0.4], sky_rgb: [0.6, 0.8, 1] };
  await settled(page, (light) => (globalThis as Global).map.setLight(light), evening);
  await page.screenshot({ path: `${OUT}/model-evening.png` });
  expect((await judged(page, evening)).wrong.slice(0, 5)).toEqual([]);
  await settled(page, () => (globalThis as Global).map.setLight({ lit: false }), null);
  expect((await judged(page, { ...DEFAULT_LIGHT, ambient: 1, diffuse: 0 })).wrong.slice(0, 5)).toEqual([]);
  await settled(page, (light) => (globalThis as Global).map.setLight(light), DEFAULT_LIGHT);

  await settled(page, () => (globalThis as Modelling).model.remove(), null);
  expect(before.equals(await picture(page))).toBe(true);
  await settled(page, () => (globalThis as Modelling).model.addTo((globalThis as Global).map), null);
  expect((await judged(page, DEFAULT_LIGHT)).wrong.slice(0, 5)).toEqual([]);
  expect(problems).toEqual([]);
});

test.each([[1, 2], [1, 3.6], [2, 2.6], [2, 4.3]])("the same at %d device pixels per CSS pixel and zoom %d", async (dpr, zoom) => {
  const { page, problems } = await start({ zoom }, { deviceScaleFactor: dpr });
  await addBox(page);
  await page.screenshot({ path: `${OUT}/model-box-${String(dpr)}-${String(zoom)}.png` });
  // Edges in the images are accurate to one texel.
  const found = await judged(page, DEFAULT_LIGHT, { dpr, reach: 2 * Math.ceil(dpr * 2 ** Math.max(0, zoom - 3)) });
  expect(found.wrong.slice(0, 5)).toEqual([]);
  expect([found.before > 300, found.behind > 100]).toEqual([true, true]);
  expect(problems).toEqual([]);
});

test.each(["0-45", "90-45"])("a lawn on the ground is entirely visible at every zoom in view %s", async (direction) => {
  const { page, problems } = await start({ direction, light: { lit: false } });
  const [x, y] = [-20, -60];
  await settled(page, (position) => {
    const g = globalThis as Modelling;
    const lawn = new g.THREE.Mesh(new g.THREE.PlaneGeometry(30, 14).rotateX(-Math.PI / 2), new g.THREE.MeshBasicMaterial({ color: "#00ff00" }));
    g.model = new g.map3d.modelLayer(g.THREE, lawn, { position }).addTo(g.map);
  }, inTown(x, y, 0.02));
  for (const zoom of [1, 1.7, 2.5, 3, 4.3]) {
    await settled(page, ([at, to]) => (globalThis as Global).map.setView(at, to), [inTown(x, y, 0.03 * zoom), zoom] as const);
    const shot = await picture(page);
    const [[left, bottom], [right, top]] = await page.evaluate((corners) => corners.map((at) => (globalThis as Global).map.project(at)), direction === "0-45" ? [inTown(x - 15, y - 7, 0), inTown(x + 15, y + 7, 0)] : [inTown(x + 15, y - 7, 0), inTown(x - 15, y + 7, 0)]) as [[number, number], [number, number]];
    const wrong: string[] = [];
    for (let j = Math.max(0, Math.ceil(top) + 1); j < Math.min(HIGH, bottom - 2); j++) {
      for (let i = Math.max(0, Math.ceil(left) + 1); i < Math.min(WIDE, right - 2); i++) if (rgbAt(shot, i, j).join() !== "0,255,0") wrong.push(`${String(i)}, ${String(j)}`);
    }
    expect([zoom, wrong.slice(0, 3)]).toEqual([zoom, []]);
  }
  expect(problems).toEqual([]);
});

test("with screen-space light, a model that extends beyond the images is entirely visible", async () => {
  const { page, problems } = await start();
  await page.addScriptTag({ url: "/map3d-shade.js" });
  await settled(page, () => { new (globalThis as unknown as { map3d: typeof Shading }).map3d.shade().addTo((globalThis as Global).map); }, null);
  await addBox(page);
  expect((await judged(page, DEFAULT_LIGHT)).wrong.slice(0, 5)).toEqual([]);
  await settled(page, (position) => { (globalThis as Modelling).model.setPosition(position); }, inTown(-29, -300, 300));
  const [r = 0] = await seenAt(page, inTown(-29, -300, 324));
  expect(Math.abs(r - (lambert(WALL, [0, 0, 1], DEFAULT_LIGHT)[0] ?? 0))).toBeLessThanOrEqual(2);
  expect(problems).toEqual([]);
});

/** Colours of the canvas at CSS pixels. */
const seenAt = async (page: Page, world: Vec3): Promise<number[]> => {
  const [x, y] = await page.evaluate((at) => (globalThis as Global).map.project(at) as [number, number], world);
  return rgbAt(await picture(page), Math.round(x), Math.round(y));
};

test("a white wall of a model has the brightness of the same wall in the images", async () => {
  const { page, problems } = await start();
  // The school's south wall and a model of it next to it, in the same colour.
  await addBox(page, { position: inTown(31, -62, 0) });
  await settled(page, () => {
    const { model, THREE } = globalThis as Modelling;
    model.object?.traverse((node) => {
      if (node instanceof THREE.Mesh) node.material = new THREE.MeshStandardMaterial({ color: new THREE.Color().setRGB(202 / 255, 205 / 255, 208 / 255, THREE.SRGBColorSpace), roughness: 1 });
    });
    model.redraw();
  }, null);
  const [wall, model] = [await seenAt(page, inTown(30.8, -46, 0.6)), await seenAt(page, inTown(30.8, -67, 12))];
  wall.forEach((byte, k) => { expect(Math.abs(byte - (model[k] ?? 0))).toBeLessThanOrEqual(6); });
  expect(problems).toEqual([]);
});

/** Clicks at a world position; returns the events of the model and of the map. */
async function clicked(page: Page, world: Vec3): Promise<{ model: { object: string; position: Vec3 } | null; id: number }> {
  const [x, y] = await page.evaluate((at) => {
    const g = globalThis as Modelling & { hit: unknown };
    g.hit = null;
    g.clicks.length = 0;
    return g.map.project(at) as [number, number];
  }, world);
  await page.mouse.click(x, y);
  await page.waitForFunction(() => (globalThis as Global).clicks.length > 0);
  return page.evaluate(() => {
    const { hit, clicks } = globalThis as unknown as { hit: { object: string; position: Vec3 } | null; clicks: { id: number }[] };
    return { model: hit, id: clicks[0]?.id ?? 0 };
  });
}

test("a click on the visible part of a model fires its event and the pointer shows it; the map's click reports the images", async () => {
  const { page, problems } = await start();
  await addBox(page);
  await page.evaluate(() => {
    const g = globalThis as Modelling & { hit: unknown };
    g.model.on("click", ({ object, position, intersection }) => (g.hit = { object: object.type, position, distance: intersection.distance }));
  });
  const top = inTown(-20, 23, 24);
  const { model, id } = await clicked(page, top);
  expect(model?.object).toBe("Mesh");
  model?.position.forEach((part, k) => { expect(Math.abs(part - (top[k] ?? 0))).toBeLessThan(0.5); });
  expect(id).toBe(3_900_000_007); // the chapel behind it
  const over = (): Promise<string> => page.evaluate(() => getComputedStyle((globalThis as Global).map.canvas).cursor);
  await page.waitForFunction(() => (globalThis as Global).map.container.classList.contains("map3d-over-model"));
  expect(await over()).toBe("pointer");
  expect(await clicked(page, inTown(-40, 18, 10))).toEqual({ model: null, id: 17 }); // behind the town hall
  await page.waitForFunction(() => !(globalThis as Global).map.container.classList.contains("map3d-over-model"));
  expect(await clicked(page, inTown(-20, -60, 0))).toEqual({ model: null, id: 3 });
  expect(problems).toEqual([]);
});

test("removing a model frees all its GPU resources", async () => {
  const { page, problems } = await start();
  await addBox(page);
  await settled(page, () => (globalThis as Modelling).model.remove(), null);
  await page.evaluate(() => {
    const context = WebGL2RenderingContext.prototype as unknown as Record<string, (...given: unknown[]) => unknown>;
    const alive: Record<string, number> = {};
    for (const kind of ["Texture", "Buffer", "Framebuffer", "Renderbuffer", "Program", "Shader", "VertexArray"]) {
      alive[kind] = 0;
      for (const [verb, step] of [["create", 1], ["delete", -1]] as const) {
        const own = context[`${verb}${kind}`] as (...given: unknown[]) => unknown;
        context[`${verb}${kind}`] = function (this: unknown, ...given: unknown[]) {
          alive[kind] = (alive[kind] ?? 0) + step;
          return own.apply(this, given);
        };
      }
    }
    Object.assign(globalThis, { alive });
  });
  await settled(page, () => (globalThis as Modelling).model.addTo((globalThis as Global).map), null);
  const alive = (): Promise<Record<string, number>> => page.evaluate(() => (globalThis as unknown as { alive: Record<string, number> }).alive);
  // Two of three.js, and those that a map with depth needs.
  expect((await alive())["Renderbuffer"]).toBe(4);
  await settled(page, () => (globalThis as Modelling).model.remove(), null);
  // three.js keeps four textures of one pixel, and empty framebuffers.
  expect(Object.entries(await alive()).filter(([, count]) => count > 0)).toEqual([["Texture", 4], ["Framebuffer", 3]]);
  expect(problems).toEqual([]);
});

/** Waits for some frames. */
const moving = (page: Page): Promise<void> => page.evaluate(() => new Promise<void>((done) => {
  let left = 5;
  const { frameEvents } = (globalThis as Global).map;
  frameEvents.on("draw", () => { if (--left === 0) done(); });
}));

/** Counts the frames that the map draws in a number of milliseconds. */
const framesIn = (page: Page, ms: number): Promise<number> => page.evaluate((duration_ms) => new Promise<number>((done) => {
  const { map } = globalThis as Global;
  let count = 0;
  const counted = (): void => { count++; };
  map.frameEvents.on("draw", counted);
  setTimeout(() => {
    map.frameEvents.off("draw", counted);
    done(count);
  }, duration_ms);
}), ms);

const addTriangle = (page: Page, options: object): Promise<void> => page.evaluate(([origin, more]) => new Promise<void>((done) => {
  const g = globalThis as Modelling;
  g.model = new g.map3d.modelLayer(g.THREE, "/triangle.gltf", { position: origin, loader: g.GLTFLoader, ...more });
  g.model.on("ready", () => { done(); }).addTo(g.map);
}), [inTown(-45, -40, 0), options] as const);

test("a glTF plays and stops its clips; a still model draws no frames; with reduced motion clips play only on request", async () => {
  const { page, problems } = await start();
  await addTriangle(page, { heading_deg: 0 });
  expect(await page.evaluate(() => [(globalThis as Modelling).model.clips, (globalThis as Modelling).model.playing])).toEqual([["up"], true]);
  await moving(page);
  await settled(page, () => (globalThis as Modelling).model.stop(), null);
  expect(await framesIn(page, 300)).toBe(0);
  const isRed = async (at: Vec3): Promise<boolean> => {
    const [r = 0, g = 0] = await seenAt(page, at);
    return r > 100 && g < 40;
  };
  const [foot, above] = [inTown(-45, -40, 4), inTown(-45, -40, 34)];
  expect([await isRed(foot), await isRed(above)]).toEqual([true, false]);
  await settled(page, () => (globalThis as Modelling).model.play("up", { loop: false }), null);
  expect([await isRed(foot), await isRed(above)]).toEqual([false, true]);
  expect(await framesIn(page, 300)).toBe(0);
  expect(await page.evaluate(() => {
    try {
      (globalThis as Modelling).model.play("down");
      return "";
    } catch (error) {
      return (error as Error).message;
    }
  })).toBe('unknown animation "down"; the model has "up"');
  expect(problems).toEqual([]);
  await page.context().close();

  const { page: calm } = await start({}, { reducedMotion: "reduce" });
  await addTriangle(calm, {});
  await settled(calm, () => (globalThis as Modelling).model.redraw(), null);
  expect(await framesIn(calm, 300)).toBe(0);
  await calm.evaluate(() => (globalThis as Modelling).model.play());
  await moving(calm);
});

test("position, heading and scale in metres of the scene; bounds for fitBounds", async () => {
  const { page, problems } = await start();
  await addTriangle(page, { play: false });
  const boundsOf = (): Promise<number[][]> => page.evaluate((origin) => ((globalThis as Modelling).model.bounds ?? []).map((corner) => corner.map((part, k) => Math.round((part - (origin[k] ?? 0)) * 1e3) / 1e3)), ORIGIN);
  expect(await boundsOf()).toEqual([[-55, -40, 0], [-35, -40, 20]]);
  await settled(page, (at) => (globalThis as Modelling).model.setPosition(at).setHeading(90).setScale(0.5), inTown(10, -60, 2));
  expect(await boundsOf()).toEqual([[10, -65, 2], [10, -55, 12]]);
  await settled(page, () => (globalThis as Modelling).model.setHeading(-90).setPosition([691010, 5335940, 502]), null);
  await settled(page, () => (globalThis as Modelling).model.setHeading(0), null);
  expect((await seenAt(page, inTown(10, -60, 6)))[1]).toBeLessThan(40);
  expect(problems).toEqual([]);
});

test("missing WebGL, loader or file and invalid numbers are errors", async () => {
  const { page, problems } = await start({ drawer: "canvas" });
  const before = await picture(page);
  const errors = await page.evaluate((position) => new Promise<string[]>((done) => {
    const g = globalThis as Modelling;
    const said: string[] = [];
    const attempt = (act: () => unknown): void => {
      try {
        act();
      } catch (error) {
        said.push((error as Error).message);
      }
    };
    attempt(() => new g.map3d.modelLayer(g.THREE, "/a.glb", { position }));
    attempt(() => new g.map3d.modelLayer(g.THREE, new g.THREE.Group(), { position: [1, NaN, 2] }));
    attempt(() => new g.map3d.modelLayer(g.THREE, new g.THREE.Group(), { position, scale: 0 }));
    attempt(() => new g.map3d.modelLayer({ ...g.THREE, REVISION: "124" }, new g.THREE.Group(), { position }));
    g.model = new g.map3d.modelLayer(g.THREE, new g.THREE.Group(), { position }).addTo(g.map);
    g.model.on("error", ({ error }) => {
      said.push(error.name, error.message);
      done(said);
    });
  }), ORIGIN);
  const canvas = "a modelLayer needs WebGL, but this map draws on a 2D canvas; check map.drawer and show a marker instead";
  expect(errors).toEqual(['a modelLayer needs a loader for "/a.glb", e.g. { loader: GLTFLoader }', "position y must be a number, got NaN", "scale must be greater than 0, got 0", "a modelLayer needs three.js r155 or newer, got r124", "UsageError", canvas]);
  expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([canvas]);
  await settled(page, () => (globalThis as Modelling).map.panBy(0, 0).setLight({}), null);
  expect(before.equals(await picture(page))).toBe(true);
  await page.evaluate(() => (globalThis as Modelling).model.remove());
  expect(problems).toEqual([]);
  await page.context().close();

  const { page: other } = await start();
  expect(await other.evaluate((position) => new Promise<unknown[]>((done) => {
    const g = globalThis as Modelling;
    new g.map3d.modelLayer(g.THREE, "/none.gltf", { position, loader: new g.GLTFLoader() }).addTo(g.map).on("error", ({ error }) => { done([error.name, (error as { status?: number }).status, error.message.startsWith("/none.gltf: ")]); });
  }), ORIGIN)).toEqual(["FetchError", 404, true]);
});

test("a restored context has the model; removing the map removes it", async () => {
  const { page } = await start();
  await addBox(page);
  const before = await picture(page);
  await page.evaluate(() => new Promise<void>((done) => {
    const { map } = globalThis as Global;
    const lose = map.canvas.getContext("webgl2")?.getExtension("WEBGL_lose_context");
    map.once("contextlost", () => setTimeout(() => lose?.restoreContext(), 50));
    map.once("contextrestored", () => map.once("idle", () => { done(); }));
    lose?.loseContext();
  }));
  expect((await judged(page, DEFAULT_LIGHT)).wrong.slice(0, 5)).toEqual([]);
  expect(before.equals(await picture(page))).toBe(true);
  await page.evaluate(() => (globalThis as Modelling).map.remove());
  await page.waitForTimeout(200);
  expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([]);
});

test("the model rotates with the map; the transition ends in the picture of an immediate change", async () => {
  const { page, problems } = await start({ light: { lit: false } });
  await addBox(page);
  await settled(page, () => (globalThis as Global).map.setDirection("90-45"), null);
  const cut = await picture(page);
  await settled(page, () => (globalThis as Global).map.setDirection("0-45"), null);
  await page.addScriptTag({ url: "/map3d-orbit.js" });
  await settled(page, () => { new (globalThis as unknown as { map3d: typeof Orbit }).map3d.orbit({ duration_ms: 300 }).addTo((globalThis as Global).map); }, null);
  await page.evaluate(() => { (globalThis as Global).map.rotateBy(Math.PI / 9); });
  await page.waitForFunction(() => (globalThis as Global).map.direction === "90-45");
  await answered(page);
  const shot = await steady(page, () => picture(page), 6);
  await page.screenshot({ path: `${OUT}/model-turning.png` });
  const turned = { ...frame, axes: computeAxes(20, 45), d0: -2000 };
  const [[x0, y0], px] = await page.evaluate((origin) => [(globalThis as Global).map.project(origin) as [number, number], (globalThis as Global).map.metresPerPixel] as const, ORIGIN);
  let [all, right] = [0, 0];
  for (let y = 1; y < HIGH; y += 2) {
    for (let x = 1; x < WIDE; x += 2) {
      const [u, v] = [(x + 0.5 - x0) * px, (y0 - y - 0.5) * px];
      const [box, other] = [trace(turned, u, v, [BOX]), trace(turned, u, v)];
      if (!box || (other && other.d < box.d)) continue;
      all++;
      if (rgbAt(shot, x, y).every((byte, k) => Math.abs(byte - (WALL[k] ?? 0)) <= 8)) right++;
    }
  }
  expect(all).toBeGreaterThan(500);
  expect(right / all).toBeGreaterThan(0.8); // what neither direction sees is closed with the colours behind
  await page.evaluate(() => { (globalThis as Global).map.rotateBy(Math.PI / 3); });
  await settled(page, () => { (globalThis as Global).map.endGesture(); }, null);
  expect(cut.equals(await picture(page))).toBe(true);
  expect(problems).toEqual([]);
});

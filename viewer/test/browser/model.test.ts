import type { Page } from "playwright-core";
import type * as THREE from "three";
import type { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { beforeAll, expect, test } from "vitest";
import type * as Model from "../../src/model";
import { dot, type Vec3 } from "../../src/core/vec";
import { frameOf } from "../../src/geo/frame";
import { DEFAULT_LIGHT, towardsLight, type Light } from "../../src/geo/light";
import { renderTown } from "../fixture/rendering";
import { threeScript, triangleGltf } from "../fixture/three";
import { ORIGIN, trace, type Hit, type Thing } from "../fixture/town";
import { TestBed } from "./bed";
import { OUT } from "./browser";
import { picture, settled, type Global } from "./page";

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

const frame = frameOf(town.json.views[0] as (typeof town.json.views)[0], town.json.size_m, town.json.tile_px, town.json.zmax);

/** What the ray through a pixel's middle meets of the town and of the box. */
async function raysOf(page: Page): Promise<(x: number, y: number) => { town: Hit | null; box: Hit | null }> {
  const [[x0, y0], px] = await page.evaluate((origin) => [(globalThis as Global).map.project(origin) as [number, number], (globalThis as Global).map.metresPerPixel] as const, ORIGIN);
  return (x, y) => {
    const [u, v] = [(x + 0.5 - x0) * px, (y0 - y - 0.5) * px];
    return { town: trace(frame, u, v), box: trace(frame, u, v, [BOX]) };
  };
}

const linear = (byte: number): number => (byte / 255 <= 0.04045 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4);
const srgb = (value: number): number => 255 * (value <= 0.0031308 ? value * 12.92 : 1.055 * value ** (1 / 2.4) - 0.055);
const lambert = (color: Vec3, normal: Vec3, light: Light): number[] =>
  color.map((byte, k) => srgb(Math.min(1, linear(byte) * (light.ambient * (light.sky_rgb[k] ?? 0) + light.diffuse * (light.sun_rgb[k] ?? 0) * Math.max(0, dot(normal, towardsLight(light)))))));

const rgbAt = (shot: Buffer, x: number, y: number): number[] => [...shot.subarray(4 * (WIDE * y + x), 4 * (WIDE * y + x) + 3)];

/** Pixels whose neighbours show the same faces: those that show the box wrongly, and how many there are of each kind. */
async function judged(page: Page, light: Light): Promise<{ wrong: string[]; before: number; behind: number }> {
  const [shot, raysAt] = [await picture(page), await raysOf(page)];
  const [wrong, count]: [string[], { before: number; behind: number }] = [[], { before: 0, behind: 0 }];
  for (let y = 2; y < HIGH - 2; y++) {
    for (let x = 2; x < WIDE - 2; x++) {
      const here = raysAt(x, y);
      if (!here.box) continue;
      const kind = ({ town: a, box: b }: typeof here): string => `${String(a?.id)} ${String(a?.normal)} ${String(b?.normal)} ${String(b && (!a || b.d < a.d))}`;
      if ([raysAt(x - 1, y), raysAt(x + 1, y), raysAt(x, y - 1), raysAt(x, y + 1)].some((beside) => kind(beside) !== kind(here))) continue;
      const seen = !here.town || here.box.d < here.town.d;
      count[seen ? "before" : "behind"]++;
      const want = lambert(WALL, here.box.normal, light);
      const got = rgbAt(shot, x, y);
      const same = want.every((byte, k) => Math.abs(byte - (got[k] ?? 0)) <= 2);
      // The town hall's walls have the box's colour and face as its walls do: what is hidden there is told by windows and roof alone.
      const alike = here.town && !seen && String(here.town.normal) === String(here.box.normal);
      if (!alike && same !== seen) wrong.push(`${String(x)}, ${String(y)}: ${got.join(" ")} for ${want.map(Math.round).join(" ")}, ${seen ? "seen" : "hidden"}`);
    }
  }
  return { wrong, ...count };
}

test("a box is seen exactly where it is nearer than the images, as bright as they are; taken off, the picture is as before", async () => {
  const { page, problems } = await start();
  const before = await picture(page);
  await addBox(page);
  await page.screenshot({ path: `${OUT}/model-box.png` });
  const found = await judged(page, DEFAULT_LIGHT);
  expect(found.wrong.slice(0, 5)).toEqual([]);
  expect([found.before > 3000, found.behind > 1000]).toEqual([true, true]);

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
  await page.context().close();
});

import type { Page } from "playwright-core";
import type * as THREE from "three";
import type { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { beforeAll } from "vitest";
import type * as Model from "../../src/model";
import { dot, type Vec3 } from "../../src/core/vec";
import { makeFrame } from "../../src/geo/frame";
import { towardsLight, type Light } from "../../src/geo/light";
import { renderTown } from "../fixture/rendering";
import { threeScript, triangleGltf } from "../fixture/three";
import { ORIGIN, trace, type Hit, type Thing } from "../fixture/town";
import { TestBed } from "./testBed";
import { picture, settled, type Global } from "./page";

export const town = renderTown();
export const bed = new TestBed({ town });
export const [WIDE, HIGH] = [500, 420];
export const VIEWPORT = { viewport: { width: WIDE, height: HIGH } };
export const OPTIONS = { center: [ORIGIN[0] - 30, ORIGIN[1] + 10, ORIGIN[2] + 10], zoom: 3, direction: "0-45" };
export type Modelling = Global & {
  map3d: typeof Model;
  THREE: typeof THREE;
  GLTFLoader: typeof GLTFLoader;
  model: Model.modelLayer<typeof THREE>;
};

/** A box of one colour behind the town hall, before the chapel. */
export const WALL: Vec3 = [214, 196, 160];
export const BOX: Thing = {
  id: 99,
  name: "Box",
  box: [
    [-48, 18, 0],
    [-10, 28, 24],
  ],
  wall: WALL,
  roof: WALL,
};

beforeAll(async () => {
  bed.server.pages.set("/three.js", await threeScript()).set("/triangle.gltf", triangleGltf());
  bed.server.policies.set(
    "/bare",
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src blob: data:; connect-src * data:; worker-src blob:",
  );
});

export async function start(options: object = {}, context: object = {}): ReturnType<TestBed["start"]> {
  const opened = await bed.start("town", { ...OPTIONS, ...options }, {}, { ...VIEWPORT, ...context });
  await opened.page.addScriptTag({ url: "/three.js" });
  await opened.page.addScriptTag({ url: "/map3d-model.js" });
  return opened;
}

/** The box as a three.js mesh on the map, with more options of the layer. */
export const addBox = (page: Page, options: object = {}): Promise<void> =>
  settled(
    page,
    ([{ box, wall }, origin, more]: readonly [Thing, Vec3, object]) => {
      const g = globalThis as Modelling;
      const [w, d, h] = [0, 1, 2].map((k) => box[1][k as 0] - box[0][k as 0]) as [number, number, number];
      const color = new g.THREE.Color().setRGB(wall[0] / 255, wall[1] / 255, wall[2] / 255, g.THREE.SRGBColorSpace);
      const mesh = new g.THREE.Mesh(new g.THREE.BoxGeometry(w, h, d), new g.THREE.MeshLambertMaterial({ color }));
      mesh.position.y = h / 2;
      const group = new g.THREE.Group().add(mesh);
      g.model = new g.map3d.modelLayer(g.THREE, group, {
        position: [origin[0] + box[0][0] + w / 2, origin[1] + box[0][1] + d / 2, origin[2] + box[0][2]],
        ...more,
      }).addTo(g.map);
    },
    [BOX, ORIGIN, options] as const,
  );

export const inTown = (x: number, y: number, z: number): Vec3 => [ORIGIN[0] + x, ORIGIN[1] + y, ORIGIN[2] + z];
export const rgbAt = (shot: Buffer, x: number, y: number, wide = WIDE): number[] => [
  ...shot.subarray(4 * (wide * y + x), 4 * (wide * y + x) + 3),
];

/** Returns the colour of the canvas at CSS pixels. */
export const seenAt = async (page: Page, world: Vec3): Promise<number[]> => {
  const [x, y] = await page.evaluate((at) => (globalThis as Global).map.project(at) as [number, number], world);
  return rgbAt(await picture(page), Math.round(x), Math.round(y));
};

export const frame = makeFrame(town.json.views[0] as (typeof town.json.views)[0], town.json.size_m, town.json.tile_px, town.json.zmax);

/** Finds what the ray through a pixel's centre hits in the town and on the box. */
async function raysOf(page: Page, dpr = 1): Promise<(x: number, y: number) => { town: Hit | null; box: Hit | null }> {
  const [[x0, y0], px] = await page.evaluate(
    (origin) => [(globalThis as Global).map.project(origin) as [number, number], (globalThis as Global).map.metresPerPixel] as const,
    ORIGIN,
  );
  return (x, y) => {
    const [u, v] = [((x + 0.5) / dpr - x0) * px, (y0 - (y + 0.5) / dpr) * px];
    return { town: trace(frame, u, v), box: trace(frame, u, v, [BOX]) };
  };
}

const linear = (byte: number): number => (byte / 255 <= 0.04045 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4);
const srgb = (value: number): number => 255 * (value <= 0.0031308 ? value * 12.92 : 1.055 * value ** (1 / 2.4) - 0.055);
export const lambert = (color: Vec3, normal: Vec3, light: Light): number[] =>
  color.map((byte, k) =>
    srgb(
      Math.min(
        1,
        linear(byte) *
          (light.ambient * (light.sky_rgb[k] ?? 0) +
            light.diffuse * (light.sun_rgb[k] ?? 0) * Math.max(0, dot(normal, towardsLight(light)))),
      ),
    ),
  );

/** Checks the pixels within `reach` of which only the same faces are visible: lists those that show the box wrongly, and counts them by kind. */
export async function judged(
  page: Page,
  light: Light,
  { dpr = 1, reach = 1 } = {},
): Promise<{ wrong: string[]; before: number; behind: number }> {
  const [shot, raysAt] = [await picture(page), await raysOf(page, dpr)];
  const [wrong, count]: [string[], { before: number; behind: number }] = [[], { before: 0, behind: 0 }];
  for (let y = 2; y < HIGH * dpr - 2; y += dpr) {
    for (let x = 2; x < WIDE * dpr - 2; x += dpr) {
      const here = raysAt(x, y);
      if (!here.box) continue;
      const kind = ({ town: a, box: b }: typeof here): string =>
        `${String(a?.id)} ${String(a?.normal)} ${String(b?.normal)} ${String(b && (!a || b.d < a.d))}`;
      if (
        [raysAt(x - reach, y), raysAt(x + reach, y), raysAt(x, y - reach), raysAt(x, y + reach)].some(
          (beside) => kind(beside) !== kind(here),
        )
      )
        continue;
      const seen = !here.town || here.box.d < here.town.d;
      const want = lambert(WALL, here.box.normal, light);
      const got = rgbAt(shot, x, y, WIDE * dpr);
      const same = want.every((byte, k) => Math.abs(byte - (got[k] ?? 0)) <= 2);
      // The town hall's walls have the box's colour and face as its walls do: only windows and roof show what is hidden there.
      const alike = here.town && !seen && String(here.town.normal) === String(here.box.normal);
      if (!alike) count[seen ? "before" : "behind"]++;
      if (!alike && same !== seen)
        wrong.push(`${String(x)}, ${String(y)}: ${got.join(" ")} for ${want.map(Math.round).join(" ")}, ${seen ? "seen" : "hidden"}`);
    }
  }
  return { wrong, ...count };
}

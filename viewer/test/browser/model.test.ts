import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import type * as Shading from "../../src/shade";
import type { Vec3 } from "../../src/core/vec";
import { DEFAULT_LIGHT, type Light } from "../../src/geo/light";
import { OUT } from "./browser";
import { picture, settled, type Global } from "./page";
import { HIGH, type Modelling, WALL, WIDE, addBox, inTown, judged, lambert, rgbAt, seenAt, start } from "./modelPage";

test("a box is visible exactly where it is nearer than the images, with equal brightness; removing it restores the picture", async () => {
  const { page, problems } = await start();
  const before = await picture(page);
  await addBox(page);
  await page.screenshot({ path: `${OUT}/model-box.png` });
  const found = await judged(page, DEFAULT_LIGHT);
  expect(found.wrong.slice(0, 5)).toEqual([]);
  expect([found.before > 2500, found.behind > 800]).toEqual([true, true]);

  const evening: Light = {
    ...DEFAULT_LIGHT,
    azimuth_deg: 265,
    elevation_deg: 20,
    ambient: 0.3,
    diffuse: 0.9,
    sun_rgb: [1, 0.7, 0.4],
    sky_rgb: [0.6, 0.8, 1],
  };
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

test.each([
  [1, 2],
  [1, 3.6],
  [2, 2.6],
  [2, 4.3],
])("the same at %d device pixels per CSS pixel and zoom %d", async (dpr, zoom) => {
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
  await settled(
    page,
    (position) => {
      const g = globalThis as Modelling;
      const lawn = new g.THREE.Mesh(
        new g.THREE.PlaneGeometry(30, 14).rotateX(-Math.PI / 2),
        new g.THREE.MeshBasicMaterial({ color: "#00ff00" }),
      );
      g.model = new g.map3d.modelLayer(g.THREE, lawn, { position }).addTo(g.map);
    },
    inTown(x, y, 0.02),
  );
  for (const zoom of [1, 1.7, 2.5, 3, 4.3]) {
    await settled(page, ([at, to]) => (globalThis as Global).map.setView(at, to), [inTown(x, y, 0.03 * zoom), zoom] as const);
    const shot = await picture(page);
    const [[left, bottom], [right, top]] = (await page.evaluate(
      (corners) => corners.map((at) => (globalThis as Global).map.project(at)),
      direction === "0-45" ? [inTown(x - 15, y - 7, 0), inTown(x + 15, y + 7, 0)] : [inTown(x + 15, y - 7, 0), inTown(x - 15, y + 7, 0)],
    )) as [[number, number], [number, number]];
    const wrong: string[] = [];
    for (let j = Math.max(0, Math.ceil(top) + 1); j < Math.min(HIGH, bottom - 2); j++) {
      for (let i = Math.max(0, Math.ceil(left) + 1); i < Math.min(WIDE, right - 2); i++)
        if (rgbAt(shot, i, j).join() !== "0,255,0") wrong.push(`${String(i)}, ${String(j)}`);
    }
    expect([zoom, wrong.slice(0, 3)]).toEqual([zoom, []]);
  }
  expect(problems).toEqual([]);
});

test("with screen-space light, a model that extends beyond the images is entirely visible", async () => {
  const { page, problems } = await start();
  await page.addScriptTag({ url: "/map3d-shade.js" });
  await settled(
    page,
    () => {
      new (globalThis as unknown as { map3d: typeof Shading }).map3d.shade().addTo((globalThis as Global).map);
    },
    null,
  );
  await addBox(page);
  expect((await judged(page, DEFAULT_LIGHT)).wrong.slice(0, 5)).toEqual([]);
  await settled(
    page,
    (position) => {
      (globalThis as Modelling).model.setPosition(position);
    },
    inTown(-29, -300, 300),
  );
  const [r = 0] = await seenAt(page, inTown(-29, -300, 324));
  expect(Math.abs(r - (lambert(WALL, [0, 0, 1], DEFAULT_LIGHT)[0] ?? 0))).toBeLessThanOrEqual(2);
  expect(problems).toEqual([]);
});

test("a white wall of a model has the brightness of the same wall in the images", async () => {
  const { page, problems } = await start();
  // The school's south wall and a model of it next to it, in the same colour.
  await addBox(page, { position: inTown(31, -62, 0) });
  await settled(
    page,
    () => {
      const { model, THREE } = globalThis as Modelling;
      model.object?.traverse((node) => {
        if (node instanceof THREE.Mesh)
          node.material = new THREE.MeshStandardMaterial({
            color: new THREE.Color().setRGB(202 / 255, 205 / 255, 208 / 255, THREE.SRGBColorSpace),
            roughness: 1,
          });
      });
      model.redraw();
    },
    null,
  );
  const [wall, model] = [await seenAt(page, inTown(30.8, -46, 0.6)), await seenAt(page, inTown(30.8, -67, 12))];
  wall.forEach((byte, k) => {
    expect(Math.abs(byte - (model[k] ?? 0))).toBeLessThanOrEqual(6);
  });
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
    g.model.on(
      "click",
      ({ object, position, intersection }) => (g.hit = { object: object.type, position, distance: intersection.distance }),
    );
  });
  const top = inTown(-20, 23, 24);
  const { model, id } = await clicked(page, top);
  expect(model?.object).toBe("Mesh");
  model?.position.forEach((part, k) => {
    expect(Math.abs(part - (top[k] ?? 0))).toBeLessThan(0.5);
  });
  expect(id).toBe(3_900_000_007); // the chapel behind it
  const over = (): Promise<string> => page.evaluate(() => getComputedStyle((globalThis as Global).map.canvas).cursor);
  await page.waitForFunction(() => (globalThis as Global).map.container.classList.contains("map3d-over-model"));
  expect(await over()).toBe("pointer");
  expect(await clicked(page, inTown(-40, 18, 10))).toEqual({ model: null, id: 17 }); // behind the town hall
  await page.waitForFunction(() => !(globalThis as Global).map.container.classList.contains("map3d-over-model"));
  expect(await clicked(page, inTown(-20, -60, 0))).toEqual({ model: null, id: 3 });
  expect(problems).toEqual([]);
});

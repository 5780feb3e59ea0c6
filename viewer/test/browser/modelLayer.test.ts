import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import type * as Orbit from "../../src/orbit";
import type { Vec3 } from "../../src/core/vec";
import { computeAxes } from "../../src/geo/axes";
import { DEFAULT_LIGHT } from "../../src/geo/light";
import { ORIGIN, trace } from "../fixture/town";
import { answered, OUT } from "./browser";
import { picture, settled, steady, type Global } from "./page";
import { BOX, HIGH, type Modelling, WALL, WIDE, addBox, frame, inTown, judged, rgbAt, seenAt, start } from "./modelPage";

test("removing a model frees all its GPU resources", async () => {
  const { page, problems } = await start();
  await addBox(page);
  await settled(page, () => (globalThis as Modelling).model.remove(), null);
  await page.evaluate(() => {
    const context = WebGL2RenderingContext.prototype as unknown as Record<string, (...given: unknown[]) => unknown>;
    const alive: Record<string, number> = {};
    for (const kind of ["Texture", "Buffer", "Framebuffer", "Renderbuffer", "Program", "Shader", "VertexArray"]) {
      alive[kind] = 0;
      for (const [verb, step] of [
        ["create", 1],
        ["delete", -1],
      ] as const) {
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
  const alive = (): Promise<Record<string, number>> =>
    page.evaluate(() => (globalThis as unknown as { alive: Record<string, number> }).alive);
  // Two of three.js, and those that a map with depth needs.
  expect((await alive())["Renderbuffer"]).toBe(4);
  await settled(page, () => (globalThis as Modelling).model.remove(), null);
  // three.js keeps four textures of one pixel, and empty framebuffers.
  expect(Object.entries(await alive()).filter(([, count]) => count > 0)).toEqual([
    ["Texture", 4],
    ["Framebuffer", 3],
  ]);
  expect(problems).toEqual([]);
});

/** Waits for some frames. */
const moving = (page: Page): Promise<void> =>
  page.evaluate(
    () =>
      new Promise<void>((done) => {
        let left = 5;
        const { frameEvents } = (globalThis as Global).map;
        frameEvents.on("draw", () => {
          if (--left === 0) done();
        });
      }),
  );

/** Counts the frames that the map draws in a number of milliseconds. */
const framesIn = (page: Page, ms: number): Promise<number> =>
  page.evaluate(
    (duration_ms) =>
      new Promise<number>((done) => {
        const { map } = globalThis as Global;
        let count = 0;
        const counted = (): void => {
          count++;
        };
        map.frameEvents.on("draw", counted);
        setTimeout(() => {
          map.frameEvents.off("draw", counted);
          done(count);
        }, duration_ms);
      }),
    ms,
  );

const addTriangle = (page: Page, options: object): Promise<void> =>
  page.evaluate(
    ([origin, more]) =>
      new Promise<void>((done) => {
        const g = globalThis as Modelling;
        g.model = new g.map3d.modelLayer(g.THREE, "/triangle.gltf", { position: origin, loader: g.GLTFLoader, ...more });
        g.model
          .on("ready", () => {
            done();
          })
          .addTo(g.map);
      }),
    [inTown(-45, -40, 0), options] as const,
  );

test("a glTF plays and stops its clips; a still model draws no frames; with reduced motion clips play only on request", async () => {
  const { page, problems } = await start();
  await addTriangle(page, { heading_deg: 0 });
  expect(await page.evaluate(() => [(globalThis as Modelling).model.clips, (globalThis as Modelling).model.playing])).toEqual([
    ["up"],
    true,
  ]);
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
  expect(
    await page.evaluate(() => {
      try {
        (globalThis as Modelling).model.play("down");
        return "";
      } catch (error) {
        return (error as Error).message;
      }
    }),
  ).toBe('unknown animation "down"; the model has "up"');
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
  const boundsOf = (): Promise<number[][]> =>
    page.evaluate(
      (origin) =>
        ((globalThis as Modelling).model.bounds ?? []).map((corner) =>
          corner.map((part, k) => Math.round((part - (origin[k] ?? 0)) * 1e3) / 1e3),
        ),
      ORIGIN,
    );
  expect(await boundsOf()).toEqual([
    [-55, -40, 0],
    [-35, -40, 20],
  ]);
  await settled(page, (at) => (globalThis as Modelling).model.setPosition(at).setHeading(90).setScale(0.5), inTown(10, -60, 2));
  expect(await boundsOf()).toEqual([
    [10, -65, 2],
    [10, -55, 12],
  ]);
  await settled(page, () => (globalThis as Modelling).model.setHeading(-90).setPosition([691010, 5335940, 502]), null);
  await settled(page, () => (globalThis as Modelling).model.setHeading(0), null);
  expect((await seenAt(page, inTown(10, -60, 6)))[1]).toBeLessThan(40);
  expect(problems).toEqual([]);
});

test("missing WebGL, loader or file and invalid numbers are errors", async () => {
  const { page, problems } = await start({ drawer: "canvas" });
  const before = await picture(page);
  const errors = await page.evaluate(
    (position) =>
      new Promise<string[]>((done) => {
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
      }),
    ORIGIN,
  );
  const canvas = "a modelLayer needs WebGL, but this map draws on a 2D canvas; check map.drawer and show a marker instead";
  expect(errors).toEqual([
    'a modelLayer needs a loader for "/a.glb", e.g. { loader: GLTFLoader }',
    "position y must be a number, got NaN",
    "scale must be greater than 0, got 0",
    "a modelLayer needs three.js r155 or newer, got r124",
    "UsageError",
    canvas,
  ]);
  expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([canvas]);
  await settled(page, () => (globalThis as Modelling).map.panBy(0, 0).setLight({}), null);
  expect(before.equals(await picture(page))).toBe(true);
  await page.evaluate(() => (globalThis as Modelling).model.remove());
  expect(problems).toEqual([]);
  await page.context().close();

  const { page: other } = await start();
  expect(
    await other.evaluate(
      (position) =>
        new Promise<unknown[]>((done) => {
          const g = globalThis as Modelling;
          new g.map3d.modelLayer(g.THREE, "/none.gltf", { position, loader: new g.GLTFLoader() }).addTo(g.map).on("error", ({ error }) => {
            done([error.name, (error as { status?: number }).status, error.message.startsWith("/none.gltf: ")]);
          });
        }),
      ORIGIN,
    ),
  ).toEqual(["FetchError", 404, true]);
});

test("a restored context has the model; removing the map removes it", async () => {
  const { page } = await start();
  await addBox(page);
  const before = await picture(page);
  await page.evaluate(
    () =>
      new Promise<void>((done) => {
        const { map } = globalThis as Global;
        const lose = map.canvas.getContext("webgl2")?.getExtension("WEBGL_lose_context");
        map.once("contextlost", () => setTimeout(() => lose?.restoreContext(), 50));
        map.once("contextrestored", () =>
          map.once("idle", () => {
            done();
          }),
        );
        lose?.loseContext();
      }),
  );
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
  await settled(
    page,
    () => {
      new (globalThis as unknown as { map3d: typeof Orbit }).map3d.orbit({ duration_ms: 300 }).addTo((globalThis as Global).map);
    },
    null,
  );
  await page.evaluate(() => {
    (globalThis as Global).map.rotateBy(Math.PI / 9);
  });
  await page.waitForFunction(() => (globalThis as Global).map.direction === "90-45");
  await answered(page);
  const shot = await steady(page, () => picture(page), 6);
  await page.screenshot({ path: `${OUT}/model-turning.png` });
  const turned = { ...frame, axes: computeAxes(20, 45), d0: -2000 };
  const [[x0, y0], px] = await page.evaluate(
    (origin) => [(globalThis as Global).map.project(origin) as [number, number], (globalThis as Global).map.metresPerPixel] as const,
    ORIGIN,
  );
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
  await page.evaluate(() => {
    (globalThis as Global).map.rotateBy(Math.PI / 3);
  });
  await settled(
    page,
    () => {
      (globalThis as Global).map.endGesture();
    },
    null,
  );
  expect(cut.equals(await picture(page))).toBe(true);
  expect(problems).toEqual([]);
});

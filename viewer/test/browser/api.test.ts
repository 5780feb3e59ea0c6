import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import { renderTown } from "../fixture/rendering";
import { ORIGIN, PLACE, THINGS } from "../fixture/town";
import { lonLatFromLocal } from "../../src/geo/geographic";
import type { Vec2, Vec3 } from "../../src/core/vec";
import type * as Filters from "../../src/filter";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { drawn, settled, type Global } from "./page";

const bed = new TestBed({ town: renderTown() }, { draws: false });
const HALL = THINGS.find(({ id }) => id === 17);
const world = (x: number, y: number, z: number): Vec3 => [ORIGIN[0] + x, ORIGIN[1] + y, ORIGIN[2] + z];
const lonLat = (x: number, y: number): Vec2 => lonLatFromLocal(PLACE, [x, y]);
const project = (page: Page, at: Vec3): Promise<Vec2> =>
  page.evaluate((place) => (globalThis as Global).map.project(place) as Vec2, at as [number, number, number]);
const at = (page: Page): Promise<Vec2> => project(page, world(0, 0, 0));
const addEntry = (page: Page, name: string): Promise<unknown> => page.addScriptTag({ url: `${bed.server.origin}/map3d-${name}.js` });

test("classes have names in upper case, too", async () => {
  const { page } = await bed.bare();
  expect(
    await page.evaluate(() => {
      const { map3d } = globalThis as Global;
      return [
        map3d.Map === map3d.map,
        map3d.Map3D === map3d.map,
        map3d.ImageLayer === map3d.imageLayer,
        map3d.Marker === map3d.marker,
        map3d.Popup === map3d.popup,
      ];
    }),
  ).toEqual([true, true, true, true, true]);
});

test("a position is found by longitude and latitude on roofs and on the ground, hidden or not, and by the name of an object", async () => {
  const { page, problems } = await bed.start("town", { zoom: 3 });
  const places = { roof: lonLat(-45, -4), ground: lonLat(-80, -60), hidden: lonLat(32, 45) };
  const found = await page.evaluate(
    async ({ roof, ground, hidden }) => {
      const { map } = globalThis as Global;
      const [onRoof, onGround, behind, high, flat, byName, byId] = await Promise.all([
        map.findPosition({ lonLat: roof }),
        map.findPosition({ lonLat: ground, height: "ground" }),
        map.findPosition({ lonLat: hidden }),
        map.findPosition({ lonLat: roof, height: 777 }),
        map.findPosition({ xy: [690955, 5335996] }),
        map.findPosition({ object: "Town hall" }),
        map.findPosition({ object: 2_000_000_001 }),
      ]);
      const missing = await map.findPosition({ object: "Castle" }).catch((reason: unknown) => String(reason));
      return { onRoof, onGround, behind, high, flat, byName, byId, missing };
    },
    places as unknown as Record<keyof typeof places, [number, number]>,
  );
  const near = (got: Vec3, want: Vec3, by: number): void => {
    got.forEach((part, k) => {
      expect(Math.abs(part - (want[k] ?? NaN))).toBeLessThan(by);
    });
  };
  near(found.onRoof, world(-45, -4, 34), 0.6);
  near(found.onGround, world(-80, -60, 0), 0.6);
  near(found.behind, world(32, 45, 0), 0.6); // behind the tower in this view
  near(found.high, [...world(-45, -4, 0).slice(0, 2), 777] as unknown as Vec3, 0.05);
  near(found.flat, world(-45, -4, 34), 0.6);
  near(found.byName, world(-45, -4, HALL?.box[1][2] ?? NaN), 0.01);
  near(found.byId, world(32, 26, 62), 0.01);
  expect(found.missing).toBe('UsageError: no object has the name "Castle"; search finds objects by a part of their name');
  expect(problems).toEqual([]);
});

test("markers and views take such positions, and say when they cannot be found", async () => {
  const { page } = await bed.start("town", { zoom: 3 });
  await page.evaluate(
    (roof) => {
      const { map, map3d } = globalThis as Global;
      const pins = [
        new map3d.Marker("Roof", { lonLat: roof }),
        new map3d.Marker("Tower", { object: "Tower" }),
        new map3d.Marker("Nowhere", { object: "Castle" }),
      ].map((pin) => pin.bindPopup("here").addTo(map));
      Object.assign(globalThis, { pins });
    },
    lonLat(-45, -4) as [number, number],
  );
  await page.waitForFunction(() =>
    (globalThis as unknown as { pins: { position: Vec3 | null }[] }).pins.slice(0, 2).every(({ position }) => position),
  );
  const roof = page.getByRole("button", { name: "Roof" });
  const box = (await roof.boundingBox()) ?? { x: 0, y: 0, width: 0, height: 0 };
  const [x, y] = await project(page, world(-45, -4, 34));
  expect(Math.hypot(box.x + box.width / 2 - x, box.y + box.height / 2 - y)).toBeLessThan(3);
  expect(await page.locator(".map3d-marker:visible").allTextContents()).toEqual(["Roof", "Tower"]);
  expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([
    'no object has the name "Castle"; search finds objects by a part of their name',
  ]);
  await page.evaluate(
    (place) => {
      (globalThis as Global).map.setView({ lonLat: place }, 4);
    },
    lonLat(-45, -4) as [number, number],
  );
  await page.waitForFunction(() => (globalThis as Global).map.zoom === 4);
  const centre = await project(page, world(-45, -4, 34));
  expect(Math.hypot(centre[0] - 400, centre[1] - 300)).toBeLessThan(3);
  // A later call replaces one that waits for its position.
  await page.evaluate(
    async (place) => {
      const { map } = globalThis as Global;
      await map.flyTo({ lonLat: place }).setView([691000, 5336000, 500], 3).findPosition({ lonLat: place });
      await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    },
    lonLat(32, 26) as [number, number],
  );
  await drawn(page);
  expect((await at(page)).map(Math.round)).toEqual([400, 300]);
});

test("a drag beyond the bounds springs back; bounds and zooms can be limited", async () => {
  const { page } = await bed.start("town", { zoom: 4, minZoom: 3, maxZoom: 4.5, maxBounds: [world(-20, -20, 0), world(20, 20, 0)] });
  await page.mouse.move(700, 300);
  await page.mouse.down();
  for (let x = 700; x >= 100; x -= 50) await page.mouse.move(x, 300);
  const dragged = await page.evaluate(() => (globalThis as Global).map.unproject([400, 300])?.[0] ?? 0);
  await page.waitForTimeout(150);
  await page.mouse.up();
  expect(dragged - ORIGIN[0]).toBeGreaterThan(22);
  await expect
    .poll(async () => (await page.evaluate(() => (globalThis as Global).map.unproject([400, 300])?.[0] ?? 0)) - ORIGIN[0], {
      timeout: 10_000,
    })
    .toBeCloseTo(20, 2);
  const zooms = await page.evaluate(() => {
    const { map } = globalThis as Global;
    return [map.setZoom(9).zoom, map.setZoom(0).zoom, ...map.zoomLimits];
  });
  expect(zooms).toEqual([4.5, 3, 3, 4.5]);
});

test("a drag with Shift zooms to the rectangle that it draws", async () => {
  const { page } = await bed.start("town", { zoom: 3 });
  const target = await page.evaluate(() => (globalThis as Global).map.unproject([300, 250]) as Vec3);
  await page.keyboard.down("Shift");
  await page.mouse.move(200, 175);
  await page.mouse.down();
  await page.mouse.move(400, 325, { steps: 5 });
  expect(await page.locator(".map3d-box").boundingBox()).toEqual({ x: 200, y: 175, width: 200, height: 150 });
  await page.screenshot({ path: `${OUT}/box-zoom.png` });
  await page.mouse.up();
  await page.keyboard.up("Shift");
  await page.waitForFunction(() => (globalThis as Global).map.zoom > 4.99);
  expect(await page.locator(".map3d-box").count()).toBe(0);
  const [x, y] = await project(page, target);
  expect(Math.hypot(x - 400, y - 300)).toBeLessThan(2);
});

test("panTo, addLayer, removeLayer, whenReady and loaded do what their names say", async () => {
  const { page } = await bed.start("town", { zoom: 3 });
  const told = await page.evaluate(async (base) => {
    const { map, map3d, layer } = globalThis as Global;
    const steps: unknown[] = [map.loaded()];
    map.whenReady(() => steps.push("ready"));
    map.removeLayer(layer);
    steps.push(map.layers.length);
    map.addLayer(new map3d.ImageLayer(base));
    steps.push(map.loaded());
    await new Promise((done) => map.once("idle", done));
    steps.push(map.layers.length, map.loaded());
    map.panTo([691020, 5336010, 500]);
    steps.push(map.project([691020, 5336010, 500])?.map(Math.round).join() === "400,300");
    await new Promise((done) => map.once("moveend", done));
    steps.push(map.project([691020, 5336010, 500])?.map(Math.round).join());
    return steps;
  }, bed.url("town"));
  expect(told).toEqual([true, "ready", 0, false, 1, true, false, "400,300"]);
});

test("a layer tells of the pointer over its objects, and shows a tooltip", async () => {
  const { page, problems } = await bed.start("town", { zoom: 3 });
  await addEntry(page, "tooltip");
  await settled(
    page,
    () => {
      const { layer } = globalThis as Global;
      const told: string[] = [];
      for (const type of ["mouseover", "mouseout", "click"] as const) layer.on(type, ({ id }) => told.push(`${type} ${String(id)}`));
      layer.bindTooltip(({ name }) => name);
      Object.assign(globalThis, { told });
    },
    null,
  );
  const told = (): Promise<string[]> => page.evaluate(() => (globalThis as unknown as { told: string[] }).told);
  const [roof, tower] = [await project(page, world(-45, -4, 34)), await project(page, world(32, 26, 62))];
  await page.mouse.move(...(roof as [number, number]));
  await page.getByRole("tooltip").getByText("Town hall").waitFor();
  await page.mouse.move(roof[0] + 3, roof[1]);
  await page.screenshot({ path: `${OUT}/tooltip.png` });
  await page.mouse.move(...(tower as [number, number]));
  await page.getByRole("tooltip").getByText("Tower").waitFor();
  await page.mouse.click(...(tower as [number, number]));
  await expect.poll(told).toContain("click 2000000001");
  await page.mouse.move(tower[0], 0);
  await expect.poll(async () => page.getByRole("tooltip").count()).toBe(0);
  expect((await told()).filter((each) => !each.endsWith(" 3"))).toEqual([
    "mouseover 17",
    "mouseout 17",
    "mouseover 2000000001",
    "click 2000000001",
    "mouseout 2000000001",
  ]);
  await page.evaluate(() => {
    (globalThis as Global).layer.bindTooltip(null);
  });
  expect(problems).toEqual([]);
});

test("objects are highlighted by name", async () => {
  const { page } = await bed.start("town", { zoom: 3 });
  const found = await page.evaluate(async () => {
    const { layer } = globalThis as Global;
    return [
      await layer.highlightByName("Chapel"),
      layer.highlighted,
      await layer.findByName("chapel"),
      await layer.highlightByName("Castle").catch((reason: unknown) => (reason as Error).name),
    ];
  });
  expect(found).toEqual([[3_900_000_007], [3_900_000_007], [], "UsageError"]);
});

test("controls stand in the corners that are asked for", async () => {
  const { page, problems } = await bed.bare();
  await addEntry(page, "controls");
  await page.evaluate(
    ([base]) =>
      new Promise<void>((done) => {
        const g = globalThis as Global & {
          map3d: { Control: new (element: HTMLElement, options: object) => { addTo(map: Global["map"]): unknown } };
        };
        g.map = new g.map3d.Map("mapcanvas", { controls: "topleft", scaleBar: "topright", attribution: "bottomleft" });
        g.map.add(new g.map3d.ImageLayer(base, { attribution: "City of Testing" }));
        const box = document.createElement("div");
        [box.textContent, box.className] = ["mine", "mine"];
        new g.map3d.Control(box, { position: "topright" }).addTo(g.map);
        g.map.once("idle", () => {
          done();
        });
      }),
    [bed.url("town")] as const,
  );
  await page.screenshot({ path: `${OUT}/corners.png` });
  const boxes = await page.evaluate(() =>
    [".map3d-buttons", ".map3d-scale", ".mine", ".map3d-attribution"].map((name) => {
      const { left, top, right, bottom } = (document.querySelector(name) as Element).getBoundingClientRect();
      return [left + right < 800, top + bottom < 600, left >= 0 && top >= 0 && right <= 800 && bottom <= 600, top] as const;
    }),
  );
  expect(boxes.map(([left, top, inside]) => [left, top, inside])).toEqual([
    [true, true, true],
    [false, true, true],
    [false, true, true],
    [true, false, true],
  ]);
  expect(boxes[2]?.[3]).toBeGreaterThan(boxes[1]?.[3] ?? NaN);
  const refused = await page.evaluate(() => {
    const { map3d } = globalThis as Global & { map3d: { Control: new (element: HTMLElement, options: object) => unknown } };
    try {
      return new map3d.Control(document.body, { position: "middle" });
    } catch (reason) {
      return String(reason);
    }
  });
  expect(refused).toBe('UsageError: unknown position "middle"; use topleft, topright, bottomleft, bottomright');
  expect(problems).toEqual([]);
});

test("a filter shows the objects that fulfil an expression; objects in view and chosen ones are written as a table", async () => {
  const { page, problems } = await bed.start("town", { zoom: 3 });
  await addEntry(page, "filter");
  const found = await page.evaluate(async () => {
    const { map, layer, map3d } = globalThis as Global & { map3d: typeof Filters };
    const high = await map3d.findObjects(layer, ["all", [">", "measuredHeight", 20], ["==", "class", "building"]]);
    const shown = new map3d.Filter(layer, [">=", "measuredHeight", 34], { others: "hidden" });
    const { ids } = await new Promise<{ ids: readonly number[] }>((done) => {
      shown.on("change", done);
      map.add(shown);
    });
    await new Promise((done) => map.once("idle", done));
    const [all, one] = [await map3d.exportCsv(map), await map3d.exportCsv(map, { layer, ids: [1025] })];
    const missing = await map3d.findObjects(layer, [">", "storeys", 3]).catch((reason: unknown) => String(reason));
    return { high, ids, hidden: [17, 1025].map((id) => layer.isHidden(id)), all, one, missing };
  });
  expect([found.high, found.ids, found.hidden]).toEqual([
    [17, 2_000_000_001],
    [17, 2_000_000_001],
    [false, true],
  ]);
  expect(found.all.split("\r\n")).toEqual([
    "id,name,class,architect,listed,measuredHeight,note,roofType",
    "17,Town hall,building,,true,34,<img src=x onerror=alert(1)>,3100",
    "2000000001,Tower,building,,true,62,<img src=x onerror=alert(1)>,1000",
    "",
  ]);
  expect(found.one).toContain("1025,School <b>old</b>,building,,true,16,");
  expect(found.missing).toBe('UsageError: no attribute "storeys"; the rendering has class, listed, measuredHeight, note, roofType');
  expect(problems).toEqual([]);
});

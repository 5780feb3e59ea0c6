import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import type * as Cluster from "../../src/cluster";
import type * as Geojson from "../../src/geojson";
import type { Vec3 } from "../../src/map3d";
import { computeAxes, localFromUvd } from "../../src/geo/axes";
import { renderTown } from "../fixture/rendering";
import { ORIGIN, trace } from "../fixture/town";
import { makeFrame } from "../../src/geo/frame";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { placeOf } from "./level";
import { settled, type Global } from "./page";

const town = renderTown();
const bed = new TestBed({ town }, { draws: false });
type Featured = Global & {
  map3d: typeof Geojson & typeof Cluster;
  overlay: Geojson.geojson;
  group: Cluster.cluster;
  told: string[];
  pin: InstanceType<Global["map3d"]["marker"]>;
};
const frame = makeFrame(town.json.views[0] as never, town.json.size_m, town.json.tile_px, town.json.zmax);
const world = (x: number, y: number, z?: number): number[] => [ORIGIN[0] + x, ORIGIN[1] + y, ...(z === undefined ? [] : [ORIGIN[2] + z])];
const VIEWPORT = { viewport: { width: 560, height: 420 } };

async function show(page: Page, data: object, options: object): Promise<void> {
  await page.addScriptTag({ url: "/map3d-geojson.js" });
  await page.evaluate(
    ([given, chosen]) =>
      new Promise<void>((done) => {
        const g = globalThis as unknown as Featured;
        g.told = [];
        g.overlay = new g.map3d.geojson(given, { crs: "scene", ...chosen });
        for (const type of ["click", "mouseover", "mouseout"] as const)
          g.overlay.on(type, ({ feature }) => g.told.push(`${type} ${String(feature.properties?.["name"])}`));
        let idle = false;
        g.overlay.on("load", () => {
          if (idle) done();
        });
        g.overlay.addTo(g.map);
        g.map.once("idle", () => {
          idle = true;
          g.overlay.setStyle(chosen["style" as never]);
        });
      }),
    [data, options] as const,
  );
}

/** Opacity of the overlay's pixels, from the top. */
const opacities = (page: Page): Promise<number[]> =>
  page.evaluate(() => {
    const canvas = document.querySelector(".map3d-geojson") as HTMLCanvasElement;
    const { data } = (canvas.getContext("2d") as CanvasRenderingContext2D).getImageData(0, 0, canvas.width, canvas.height);
    return Array.from({ length: data.length / 4 }, (_, k) => data[4 * k + 3] ?? 0);
  });

test.each(["webgl", "canvas"])(
  "%s: a draped polygon covers exactly the pixels whose surface is inside it; a line is hidden where the model is in front of it",
  async (drawer) => {
    const { page, problems } = await bed.start("town", { zoom: 3, drawer }, {}, VIEWPORT);
    const ring = [
      [-70, -30],
      [65, -60],
      [70, 60],
      [-5, 5],
      [-50, 50],
    ] as const;
    await show(
      page,
      { type: "Polygon", coordinates: [[...ring, ring[0]].map(([x, y]) => world(x, y))] },
      { style: { width: 0, fill: "#ff0000", fillOpacity: 1 } },
    );
    const [left, top] = await placeOf(page);
    const got = await opacities(page);
    await page.screenshot({ path: `${OUT}/geojson-${drawer}.png` });
    const px = frame.size / (frame.tilePx * 2 ** frame.zmax);
    const inside = (x: number, y: number): boolean =>
      ring.filter(([ax, ay], k) => {
        const [bx, by] = ring[(k + 1) % ring.length] as (typeof ring)[0];
        return ay > y !== by > y && x < ax + ((bx - ax) * (y - ay)) / (by - ay);
      }).length %
        2 ===
      1;
    let [wrong, covered] = [0, 0];
    for (let at = 0; at < got.length; at++) {
      const [u, v] = [frame.u0 + ((at % 560) - left + 0.5) * px, frame.v0 - (Math.floor(at / 560) - top + 0.5) * px];
      const hit = trace(frame, u, v);
      const [x, y] = hit ? localFromUvd(computeAxes(0, 45), [u, v, frame.d0 + hit.d]) : [NaN, NaN];
      const near = [-0.06, 0.06].some((by) => inside(x, y + by) !== inside(x, y));
      if (near) continue;
      if (hit && inside(x, y)) covered++;
      if ((got[at] ?? 0) > 0 !== (hit !== null && inside(x, y))) wrong++;
    }
    expect(covered).toBeGreaterThan(20_000);
    expect(wrong).toBe(0);
    await page.evaluate(() => {
      (globalThis as unknown as Featured).overlay.remove();
    });
    await show(
      page,
      { type: "LineString", coordinates: [world(-90, 70, 12), world(90, 70, 12)] },
      { occlusion: "hide", style: { halo: null, width: 3 } },
    );
    const line = await opacities(page);
    let odd = 0;
    for (let k = 0; k < 900; k++) {
      const local: Vec3 = [-90 + (180 * (k + 0.5)) / 900, 70, 12];
      const { right, up, forward } = frame.axes;
      const [u, v, d] = [right, up, forward].map((axis) => axis[0] * local[0] + axis[1] * local[1] + axis[2] * local[2]) as [
        number,
        number,
        number,
      ];
      const hit = trace(frame, u, v);
      const hidden = hit !== null && frame.d0 + hit.d < d - 0.1;
      const at = Math.floor((frame.v0 - v) / px + top) * 560 + Math.floor((u - frame.u0) / px + left);
      if ((line[at] ?? 0) < 128 !== hidden) odd++;
    }
    expect(odd, "of 900, at the ends of what is hidden").toBeLessThan(60);
    expect(problems).toEqual([]);
  },
);

test("features fire events for pointer and keyboard; names are text; removing the layer leaves nothing behind", async () => {
  const { page, problems } = await bed.start("town", { zoom: 3 }, {}, VIEWPORT);
  const name = "<img src=x onerror=alert(1)>";
  await show(
    page,
    {
      type: "FeatureCollection",
      features: [
        {
          type: "Feature",
          properties: { name },
          geometry: { type: "Polygon", coordinates: [[world(4, -46, 16), world(58, -46, 16), world(58, -18, 16), world(4, -18, 16)]] },
        },
        { type: "Feature", properties: { name: "dot" }, geometry: { type: "Point", coordinates: world(-80, -60) } },
      ],
    },
    {},
  );
  const at = await page.evaluate(
    (places) => places.map((place) => (globalThis as Global).map.project(place as unknown as Vec3) as [number, number]),
    [world(30, -30, 16), world(-80, -60, 0)],
  );
  const toldOf = (): Promise<string[]> => page.evaluate(() => (globalThis as unknown as Featured).told);
  for (const [k, [x, y]] of at.entries()) {
    const feature = k === 0 ? name : "dot";
    await page.mouse.move(x, y);
    await expect.poll(toldOf).toContain(`mouseover ${feature}`);
    await page.mouse.click(x, y);
    await expect.poll(toldOf).toContain(`click ${feature}`);
  }
  await page.locator(".map3d-features button").first().focus();
  await page.keyboard.press("Enter");
  const told = await toldOf();
  expect(told).toEqual([`mouseover ${name}`, `click ${name}`, `mouseout ${name}`, "mouseover dot", "click dot", `click ${name}`]);
  expect(await page.locator(".map3d-features button").allTextContents()).toEqual([name, "dot"]);
  expect(await page.locator(".map3d img").count()).toBe(0);
  await page.evaluate(() => {
    (globalThis as unknown as Featured).overlay.remove();
  });
  expect(await page.locator(".map3d-geojson, .map3d-features").count()).toBe(0);
  expect(problems).toEqual([]);
});

test("a dragged marker stays on the surface; a marker behind a building is pale", async () => {
  const { page, problems } = await bed.start("town", { zoom: 3 }, {}, VIEWPORT);
  await page.addScriptTag({ url: "/map3d-drag.js" });
  await settled(
    page,
    ([from, behind]) => {
      const g = globalThis as unknown as Featured;
      g.told = [];
      g.pin = new g.map3d.marker("Pin", from as unknown as Vec3, { draggable: true, showLabel: false }).addTo(g.map);
      for (const type of ["dragstart", "drag", "dragend", "click"] as const) g.pin.on(type, () => g.told.push(type));
      new g.map3d.marker("Hidden", behind as unknown as Vec3, { occlusion: "fade" }).addTo(g.map);
    },
    [world(-80, -60, 0), world(32, 45, 1)],
  );
  expect(await page.locator(".map3d-marker-occluded").allTextContents()).toEqual(["Hidden"]);
  const [from, to] = (await page.evaluate(
    (places) => places.map((place) => (globalThis as Global).map.project(place as unknown as Vec3) as [number, number]),
    [world(-80, -60, 0), world(-45, -4, 34)],
  )) as [[number, number], [number, number]];
  await page.mouse.move(...from);
  await page.mouse.down();
  await page.mouse.move(from[0] + 20, from[1] - 10, { steps: 3 });
  await page.mouse.move(...to, { steps: 4 });
  await page.mouse.up();
  const landed = await page.evaluate(() => (globalThis as unknown as Featured).pin.position as Vec3);
  world(-45, -4, 34).forEach((value, k) => {
    expect(Math.abs((landed[k] ?? 0) - value)).toBeLessThan(0.6);
  });
  const told = await page.evaluate(() => (globalThis as unknown as Featured).told);
  expect([told[0], told.at(-1), new Set(told).size]).toEqual(["dragstart", "dragend", 3]);
  await page.locator(".map3d-marker[aria-label=Pin]").focus();
  await page.keyboard.press("ArrowRight");
  expect((await page.evaluate(() => (globalThis as unknown as Featured).pin.position as Vec3))[0] - landed[0]).toBeCloseTo(3.8, 1);
  expect(problems).toEqual([]);
});

test("10,000 markers in clusters: few elements, no marker lost, the same after a round trip; equal positions spread", async () => {
  const { page, problems } = await bed.start("town", { zoom: 3 }, {}, VIEWPORT);
  await page.addScriptTag({ url: "/map3d-cluster.js" });
  const ms = await page.evaluate(([x, y, z]) => {
    const g = globalThis as unknown as Featured;
    let state = 5;
    const random = (): number => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32 - 0.5;
    const markers = Array.from(
      { length: 10_000 },
      (_, k) => new g.map3d.marker(`m${k}`, k < 12 ? [x - 80, y - 60, z] : [x + 180 * random(), y + 140 * random(), z]),
    );
    const start = performance.now();
    g.group = new g.map3d.cluster(markers).addTo(g.map);
    return performance.now() - start;
  }, ORIGIN);
  console.log(`10,000 markers clustered in ${ms.toFixed(0)} ms`);
  const counts = async (): Promise<string[]> => (await page.locator(".map3d-cluster").allTextContents()).sort();
  const before = await counts();
  expect(before.length).toBeLessThan(120);
  expect(
    before.reduce(
      (sum, text) => sum + Number(text.replace(/\D/g, "")),
      await page.locator(".map3d-marker:not(:has(.map3d-cluster))").count(),
    ),
  ).toBe(10_000);
  await page.screenshot({ path: `${OUT}/cluster.png` });
  for (const way of [70, -70]) await settled(page, (dx) => (globalThis as Global).map.panBy(dx, 0), way);
  expect(await counts()).toEqual(before);
  await settled(page, ([x, y, z]) => (globalThis as Global).map.setView([x - 80, y - 60, z], 5), ORIGIN);
  const many = await page.evaluate(() => {
    const far = (item: Element): number => Math.hypot(item.getBoundingClientRect().x - 280, item.getBoundingClientRect().y - 210);
    const [nearest] = [...document.querySelectorAll(".map3d-marker:has(.map3d-cluster)")].sort((a, b) => far(a) - far(b));
    (nearest as HTMLElement).focus();
    (nearest as HTMLElement).click();
    return Number(nearest?.querySelector(".map3d-cluster")?.textContent);
  });
  expect(many).toBeGreaterThan(1);
  expect(await page.locator(".map3d-legs line").count()).toBe(many);
  await page.screenshot({ path: `${OUT}/cluster-spread.png` });
  await page.keyboard.press("Escape");
  expect(await page.locator(".map3d-legs").count()).toBe(0);
  expect(problems).toEqual([]);
});

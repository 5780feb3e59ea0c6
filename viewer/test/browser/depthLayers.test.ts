import { expect, test } from "vitest";
import { uvdFromLocal } from "../../src/geo/axes";
import { makeFrame, type Frame } from "../../src/geo/frame";
import { renderTown, type Fixture } from "../fixture/rendering";
import { ORIGIN, trace, type Hit, type Place, type Thing } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { picture, settled, type Global } from "./page";

/** A planned house with its own origin and resolution: in front of some objects, behind others, on the town's ground. */
const SHIFT = [13.7, -8.3, 1.5] as const;
const HOUSE: Thing = {
  id: 77,
  name: "Planned house",
  box: [
    [-130, -20, -3],
    [6, 30, 26],
  ],
  wall: [240, 120, 30],
  roof: [250, 60, 60],
};
const PLAN: Place = {
  name: "plan",
  origin: [ORIGIN[0] + SHIFT[0], ORIGIN[1] + SHIFT[1], ORIGIN[2] + SHIFT[2]],
  box: [
    [-130, -30, -3],
    [20, 40, 30],
  ],
  things: [HOUSE],
};

const town = renderTown();
const plan = renderTown(128, 0.29, PLAN);
const abroad: Fixture = { ...plan, json: { ...plan.json, name: "abroad", crs: { ...plan.json.crs, epsg: 2056, name: "CH1903+ / LV95" } } };
const bed = new TestBed({ town, plan, abroad });
const undrawn = new TestBed(bed.server, { draws: false });
const VIEWPORT = { viewport: { width: 500, height: 420 } };
const OPTIONS = { center: [ORIGIN[0] - 45, ORIGIN[1], ORIGIN[2]], zoom: 3, direction: "0-45", light: { lit: false } };

const frameIn = ({ json }: Fixture, id = "0-45"): Frame =>
  makeFrame(json.views.find((view) => view.id === id) as (typeof json.views)[0], json.size_m, json.tile_px, json.zmax);
const [townFrame, planFrame] = [frameIn(town), frameIn(plan)];
const [du, dv, dd] = uvdFromLocal(townFrame.axes, SHIFT);

/** D and colours of the town and of the house on the ray through U and V of the town. */
function hits(u: number, v: number): { town: Hit | null; house: Hit | null; far: [number, number] } {
  const [first, second] = [trace(townFrame, u, v), trace(planFrame, u - du, v - dv, [HOUSE])];
  return { town: first, house: second, far: [first ? first.d + townFrame.d0 : Infinity, second ? second.d + planFrame.d0 + dd : Infinity] };
}

const addPlan = ([url, options]: readonly [string, object]): unknown => {
  const g = globalThis as Global & { plan: Global["layer"] };
  return (g.plan = new g.map3d.imageLayer(url, options).addTo(g.map));
};

/** The visible colours where the rays of a pixel and of its neighbours hit the same objects in the same order. */
async function judged(page: Parameters<typeof picture>[0], opacity: number): Promise<{ wrong: string[]; counts: Record<string, number> }> {
  const [shot, corner, px] = [
    await picture(page),
    await page.evaluate(() => (globalThis as Global).map.project([691000, 5336000, 500])),
    await page.evaluate(() => (globalThis as Global).map.metresPerPixel),
  ];
  const [x0, y0] = corner as [number, number];
  const [wrong, counts]: [string[], Record<string, number>] = [[], { townBefore: 0, houseBefore: 0, houseAlone: 0, townAlone: 0 }];
  for (let y = 2; y < 418; y += 3) {
    for (let x = 2; x < 498; x += 3) {
      const at = (dx: number, dy: number): ReturnType<typeof hits> => hits((x + dx + 0.5 - x0) * px, (y0 - y - dy - 0.5) * px);
      const all = [at(0, 0), at(-3, 0), at(3, 0), at(0, -3), at(0, 3)];
      const [here] = all as [ReturnType<typeof hits>];
      const kind = ({ town: a, house: b, far }: ReturnType<typeof hits>): string =>
        `${String(a?.id)} ${String(a?.normal)} ${String(b?.id)} ${String(b?.normal)} ${String(far[0] < far[1])}`;
      if (new Set(all.map(kind)).size > 1 || Math.abs(here.far[0] - here.far[1]) < 2) continue;
      const [first, second] = [here.town, here.house];
      const front = here.far[1] < here.far[0];
      if (first && second) counts[front ? "houseBefore" : "townBefore"] = (counts[front ? "houseBefore" : "townBefore"] ?? 0) + 1;
      else if (first ?? second) counts[first ? "townAlone" : "houseAlone"] = (counts[first ? "townAlone" : "houseAlone"] ?? 0) + 1;
      const got = [...shot.subarray(4 * (500 * y + x), 4 * (500 * y + x) + 4)];
      const plain = (hit: Hit | null): number[] => [...(hit?.color ?? [0, 0, 0]), hit ? 255 : 0];
      // The house has flat colours except for windows and stripes, and so have the town's objects.
      const over = opacity === 1 ? plain(second) : plain(second).map((byte, k) => byte * opacity + (plain(first)[k] ?? 0) * (1 - opacity));
      const want = front ? (first || opacity === 1 ? over : [...plain(second).slice(0, 3), 255 * opacity]) : plain(first);
      if (want.some((byte, k) => Math.abs(byte - (got[k] ?? 0)) > 12) && !nearWindow(all))
        wrong.push(`${String(x)}, ${String(y)}: ${got.join(" ")} for ${want.map(Math.round).join(" ")}`);
    }
  }
  return { wrong, counts };
}

/** Colours change from pixel to pixel there. */
const nearWindow = (all: readonly ReturnType<typeof hits>[]): boolean =>
  new Set(all.map(({ house }) => String(house?.color.map((byte) => byte >> 4)))).size > 1 ||
  new Set(all.map(({ town: hit }) => String(hit?.color.map((byte) => byte >> 4)))).size > 1;

test.each(["webgl", "canvas"])(
  "%s: of two renderings with different origins and resolutions, the nearer surface is visible",
  async (drawer) => {
    const { page, problems } = await bed.start("town", { ...OPTIONS, drawer }, {}, VIEWPORT);
    await page.evaluate(addPlan, [bed.url("plan"), {}] as const);
    await page.waitForFunction(() => (globalThis as unknown as { plan: Global["layer"] }).plan.rendering);
    await settled(page, () => (globalThis as Global).map.panBy(0, 0), null);
    await page.screenshot({ path: `${OUT}/together-${drawer}.png` });
    const { wrong, counts } = await judged(page, 1);
    expect(wrong.slice(0, 5)).toEqual([]);
    expect(Object.entries(counts).filter(([, count]) => count < 40)).toEqual([]);

    await settled(page, () => (globalThis as unknown as { plan: Global["layer"] }).plan.setOpacity(0.5), null);
    await page.screenshot({ path: `${OUT}/together-half-${drawer}.png` });
    expect((await judged(page, 0.5)).wrong.slice(0, 5)).toEqual([]);
    expect(problems).toEqual([]);
  },
);

test("picks match the visible surface; a clip shows a layer in a part of the map only", async () => {
  const { page, problems } = await undrawn.start("town", OPTIONS, {}, VIEWPORT);
  await settled(page, addPlan, [bed.url("plan"), {}] as const);
  const pickAt = (world: readonly number[]): Promise<unknown[]> =>
    page.evaluate(async (at) => {
      const { map, layer } = globalThis as Global;
      const point = map.project(at as unknown as readonly [number, number, number]) as [number, number];
      const [exact, loaded] = [await map.pick(point), map.pickLoaded(point)];
      return [
        exact.id,
        exact.layer === layer ? "town" : exact.layer ? "plan" : null,
        exact.position?.map((part, k) => Math.abs(part - (at[k] ?? 0)) < 0.6),
        loaded?.layer === exact.layer,
      ];
    }, world);
  const inTown = (x: number, y: number, z: number): number[] => [ORIGIN[0] + x, ORIGIN[1] + y, ORIGIN[2] + z];
  const near = [true, true, true];
  // The planned house's roof; the town hall's roof, which hides part of it; the chapel's roof, part of which it hides.
  expect(await pickAt(inTown(-8, 5, 27.5))).toEqual([77, "plan", near, true]);
  expect(await pickAt(inTown(-45, 0, 34))).toEqual([17, "town", near, true]);
  const chapel = inTown(-28, 50, 20);
  expect((await pickAt(chapel)).slice(0, 2)).toEqual([3_900_000_007, "town"]);
  await page.evaluate(() => (globalThis as unknown as { plan: Global["layer"] }).plan.setClip([0, 0, 0.3, 1]));
  expect((await pickAt(inTown(-8, 5, 27.5))).slice(0, 2)).toEqual([3, "town"]);
  await page.screenshot({ path: `${OUT}/together-clip.png` });
  expect(problems).toEqual([]);
});

test("a rendering in another CRS is refused with a reason, and the first one stays", async () => {
  const { page } = await bed.start("town", OPTIONS, {}, VIEWPORT);
  const before = await picture(page);
  await page.evaluate(addPlan, [bed.url("abroad"), {}] as const);
  await page.waitForFunction(() => (globalThis as Global).errors.length > 0);
  expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([
    `rendering "abroad" cannot be shown on this map: its CRS is "EPSG:2056 CH1903+ / LV95", but the map's is "EPSG:25832 ETRS89 / UTM zone 32N"`,
  ]);
  await settled(page, () => (globalThis as Global).map.setLight({ lit: false }), null);
  expect(before.equals(await picture(page))).toBe(true);
});

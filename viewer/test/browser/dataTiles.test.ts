import { expect, test } from "vitest";
import type { Page } from "playwright-core";
import { withDataTiles } from "../fixture/encodeDataTile";
import { renderTown } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./testBed";
import { picture, settled, type Global } from "./page";

const town = renderTown();
const bed = new TestBed({ town, packed: withDataTiles(town, "packed") });
const undrawn = new TestBed(bed.server, { draws: false });
const VIEWPORT = { width: 500, height: 400 };
const POINTS = [
  [250, 200],
  [160, 170],
  [320, 260],
  [90, 330],
  [400, 120],
] as const;

/** What a map answers about some points: at once, and exactly. */
const picks = (page: Page): Promise<unknown> =>
  page.evaluate(async (points) => {
    const { map } = globalThis as Global;
    const plain = ({ id, position, approximate }: Awaited<ReturnType<Global["map"]["pick"]>>): unknown => [id, position, approximate];
    return Promise.all(points.map(async (point) => [plain(await map.pick(point)), map.findSurfaceAt(point)]));
  }, POINTS);

test.each(["webgl", "canvas"])("%s: data tiles give the same pictures and picks as PNGs", async (drawer) => {
  const pages: Page[] = [];
  for (const name of ["town", "packed"])
    pages.push((await bed.start(name, { zoom: 3, drawer, hover: true }, {}, { viewport: VIEWPORT })).page);
  const compare = async <A>(act: (argument: A) => unknown, argument: A): Promise<void> => {
    for (const page of pages) await settled(page, act, argument);
    const [plain, packed] = await Promise.all(pages.map(picture));
    expect(packed?.equals(plain as Buffer)).toBe(true);
  };
  const light = (given: object): unknown => (globalThis as Global).map.setLight(given);
  await compare(light, { azimuth_deg: 120, elevation_deg: 30 });
  await compare((ids: number[]) => (globalThis as Global).layer.highlight(ids), [17, 1025]);
  await compare((hidden: number[]) => (globalThis as Global).layer.setStyle({ hidden }), [2_000_000_001]);
  for (const mode of ["normal", "id", "depth", "lit"] as const)
    await compare((shown: typeof mode) => (globalThis as Global).layer.setMode(shown), mode);
  await compare(
    ([x, y, z]: readonly number[]) => (globalThis as Global).map.setView([x as number, y as number, z as number], 2.3),
    [ORIGIN[0] + 10, ORIGIN[1] + 4, ORIGIN[2]],
  );
  const [plain, packed] = await Promise.all(pages.map(picks));
  expect(packed).toEqual(plain);
  expect(JSON.stringify(plain)).toMatch(/17|1025|3/);
  for (const page of pages) {
    expect(await page.evaluate(() => (globalThis as Global).errors)).toEqual([]);
    await page.context().close();
  }
});

test("layers combined by depth look the same with data tiles", async () => {
  const pictures: Buffer[] = [];
  for (const drawer of ["webgl", "canvas"]) {
    for (const name of ["town", "packed"]) {
      const { page, problems } = await bed.start(name, { zoom: 3, drawer }, {}, { viewport: VIEWPORT });
      await settled(
        page,
        (base: string) => {
          const { map, map3d } = globalThis as Global;
          new map3d.imageLayer(base).addTo(map);
        },
        bed.url(name),
      );
      pictures.push(await picture(page));
      expect(problems).toEqual([]);
      await page.context().close();
    }
  }
  expect(pictures[1]?.equals(pictures[0] as Buffer)).toBe(true);
  expect(pictures[3]?.equals(pictures[2] as Buffer)).toBe(true);
});

test("one request brings normals, ids and depths; a tap on a tile in view needs no other", async () => {
  bed.server.requests.length = 0;
  const { page } = await undrawn.start("packed", { zoom: 3, dataSaver: true }, {}, { viewport: VIEWPORT }); // without tiles ahead
  const sent = (): string[] => bed.server.requests.filter((url) => url.includes("/packed/") && url.includes("/data/"));
  const before = sent();
  expect(before.length).toBeGreaterThan(3);
  expect(new Set(before).size).toBe(before.length);
  const { id, position } = await page.evaluate(async () => {
    const { id, position } = await (globalThis as Global).map.pick([250, 200]);
    return { id, position };
  });
  expect(id).toBeGreaterThan(0);
  expect(position).not.toBeNull();
  await settled(page, () => (globalThis as Global).layer.highlight(17), null);
  expect(sent()).toEqual(before);
});

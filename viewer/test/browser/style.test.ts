import { expect, test } from "vitest";
import type * as Theme from "../../src/theme";
import { renderTown } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { decodedLevel, placeOf } from "./level";
import { picture, settled, type Global } from "./page";

const town = renderTown();
const divided = renderTown();
const HEIGHTS = divideColumn(divided.files, "measuredHeight");
const bed = new TestBed({ town, divided });
const undrawn = new TestBed(bed.server, { draws: false });
type Theming = Global & { map3d: typeof Theme; theme: Theme.theme };
const [GROUND, HALL, SCHOOL, TOWER, CHAPEL] = [3, 17, 1025, 2_000_000_001, 3_900_000_007] as const;
const VIEWPORT = { viewport: { width: 500, height: 400 } };

type Bytes = readonly number[];
const grey = ([r = 0, g = 0, b = 0]: Bytes): number => 0.2126 * r + 0.7152 * g + 0.0722 * b;
/** The styled colour of a pixel, by object id. */
const expected: Record<number, (color: Bytes) => Bytes> = {
  [HALL]: (color) => [19, 137, 160].map((paint, k) => 0.15 * (color[k] ?? 0) + 0.85 * paint),
  [SCHOOL]: (color) => color.slice(0, 3),
  [TOWER]: () => [],
  [GROUND]: (color) => [0, 1, 2].map(() => 0.35 * grey(color) + 0.65 * 0.86 * 255),
  [CHAPEL]: (color) => [0, 1, 2].map(() => 0.35 * grey(color) + 0.65 * 0.86 * 255),
};
const style = ([hall, school, tower]: readonly number[]): unknown =>
  (globalThis as Global).layer.setStyle({
    colors: new Map([[hall as number, "#1389a0"]]),
    only: [hall as number, school as number],
    hidden: [tower as number],
  });

test.each(["webgl", "canvas"])("%s: every pixel has the style of its object, and a reset restores all", async (drawer) => {
  const { page, problems } = await bed.start("town", { zoom: 3, drawer, light: { lit: false } }, {}, VIEWPORT);
  const before = await picture(page);
  await settled(page, style, [HALL, SCHOOL, TOWER]);
  const after = await picture(page);
  await page.screenshot({ path: `${OUT}/style-${drawer}.png` });
  const [ids, colors] = [decodedLevel(town, "id"), decodedLevel(town, "color")];
  const [left, top] = await placeOf(page);
  const [wrong, seen]: [string[], Set<number>] = [[], new Set()];
  for (let at = 0; at < 500 * 400; at++) {
    const [x, y] = [(at % 500) - left, Math.floor(at / 500) - top];
    const [id, color] = [ids(x, y)?.readUInt32LE() ?? 0, colors(x, y)];
    if (!color || id === 0 || color[3] !== 255) continue;
    seen.add(id);
    const want = expected[id]?.([...color]) ?? [];
    const got = [...after.subarray(4 * at, 4 * at + 4)];
    const right = id === TOWER ? got[3] === 0 : got[3] === 255 && want.every((byte, k) => Math.abs(byte - (got[k] ?? 0)) <= 1.01);
    if (!right) wrong.push(`${String(x)}, ${String(y)} of object ${String(id)}: ${got.join(" ")} for ${want.join(" ")}`);
  }
  expect(wrong.slice(0, 5)).toEqual([]);
  expect([...seen].sort((a, b) => a - b)).toEqual([GROUND, HALL, SCHOOL, TOWER, CHAPEL]);
  await settled(page, () => (globalThis as Global).layer.setStyle({}), null);
  expect(before.equals(await picture(page))).toBe(true);
  expect(problems).toEqual([]);
});

test("both drawers show the same when lit", async () => {
  const shots: Buffer[] = [];
  for (const drawer of ["webgl", "canvas"]) {
    const { page } = await bed.start("town", { zoom: 3, drawer }, {}, VIEWPORT);
    await settled(page, style, [HALL, SCHOOL, TOWER]);
    await settled(page, (ids) => (globalThis as Global).layer.highlight(ids), [TOWER, CHAPEL]);
    shots.push(await picture(page));
    await page.screenshot({ path: `${OUT}/style-lit-${drawer}.png` });
    await page.context().close();
  }
  const [a, b] = shots as [Buffer, Buffer];
  const byte = (from: Buffer, k: number): number => ((from[k] ?? 0) * (k % 4 === 3 ? 255 : (from[k | 3] ?? 0))) / 255;
  let most = 0;
  for (let k = 0; k < a.length; k++) most = Math.max(most, Math.abs(byte(a, k) - byte(b, k)));
  expect(most).toBeLessThanOrEqual(2.01);
  expect(a.length).toBe(b.length);
});

test("hidden objects are neither picked nor listed as visible", async () => {
  const { page } = await undrawn.start("town", { zoom: 3 });
  const top = [ORIGIN[0] + 32, ORIGIN[1] + 26, ORIGIN[2] + 62] as const;
  const idAt = (): Promise<number> =>
    page.evaluate(async (world) => {
      const { map } = globalThis as Global;
      return (await map.pick(map.project(world) as [number, number])).id;
    }, top);
  const seen = (): Promise<number[]> => page.evaluate(async () => (await (globalThis as Global).map.objectsInView()).map(({ id }) => id));
  expect(await idAt()).toBe(TOWER);
  expect(await seen()).toContain(TOWER);
  await settled(page, (id) => (globalThis as Global).layer.setStyle({ hidden: [id] }), TOWER);
  expect(await idAt()).not.toBe(TOWER);
  expect(await seen()).not.toContain(TOWER);
});

test("attributes are read by column", async () => {
  const { page } = await undrawn.start("town");
  const found = await page.evaluate(async () => {
    const { layer } = globalThis as Global;
    const all = await layer.attributes();
    const height = all.find(({ name }) => name === "measuredHeight");
    return {
      names: all.map(({ of, name }) => `${of}.${name}`),
      height,
      values: height ? [...(await layer.column(height))] : [],
      none: (await layer.column({ column: "../../rendering" })).size,
    };
  });
  expect(found.names).toEqual(["object.class", "attributes.listed", "attributes.measuredHeight", "attributes.note", "attributes.roofType"]);
  expect(found.height).toMatchObject({ type: "number", min: 2, max: 62, objects: 5 });
  expect(found.values).toEqual([
    [GROUND, 2],
    [HALL, 34],
    [SCHOOL, 16],
    [TOWER, 62],
    [CHAPEL, 20],
  ]);
  expect(found.none).toBe(0);
});

test("a theme of a divided column reads the values of objects in view, hidden ones included", async () => {
  const { page, problems } = await undrawn.start("divided", { zoom: 3 }, {}, VIEWPORT);
  const asked: string[] = [];
  page.on("request", (request) => {
    if (request.url().includes(HEIGHTS)) asked.push(request.url().replace(/^.*columns\//, ""));
  });
  await page.addScriptTag({ url: "/map3d-theme.js" });
  const idsOf = (): Promise<(readonly number[])[]> =>
    page.evaluate(() => (globalThis as unknown as Theming).theme.classes.map(({ ids }) => ids));
  const near = await page.evaluate(
    async (tower) => {
      const g = globalThis as unknown as Theming;
      await new Promise<void>((done) => {
        g.map
          .once("idle", () => {
            done();
          })
          .setView(tower, 8);
      });
      const seen = (await g.map.objectsInView()).map(({ id }) => id);
      g.theme = new g.map3d.theme(g.layer, "measuredHeight", { language: "en", others: "hidden" }).addTo(g.map);
      await new Promise<void>((done) => {
        g.theme.once("ready", () => {
          done();
        });
      });
      return seen;
    },
    [ORIGIN[0] + 32, ORIGIN[1] + 26, ORIGIN[2] + 62] as const,
  );
  const shardsOf = (ids: readonly number[]): string[] =>
    [...new Set(ids.map((id) => `${HEIGHTS}/${String(Math.floor(id / 1024))}.json`))].sort();
  expect(near.length).toBeLessThan(5);
  expect(asked[0]).toBe(`${HEIGHTS}.json`);
  expect(asked.slice(1).sort()).toEqual(shardsOf(near));
  expect(await page.locator(".map3d-legend button").count()).toBe(5);
  await page.evaluate((center) => {
    (globalThis as Global).map.setView([...center], 3);
  }, ORIGIN);
  await expect.poll(idsOf, { timeout: 20_000 }).toEqual([[GROUND], [SCHOOL], [CHAPEL], [HALL], [TOWER]]);
  expect(asked.length).toBe(new Set(asked).size);
  expect(problems).toEqual([]);
});

test("a theme colours objects, filters by its legend, and restores all; an unknown attribute is an error", async () => {
  const { page, problems } = await bed.start("town", { zoom: 3 }, {}, VIEWPORT);
  const before = await picture(page);
  await page.addScriptTag({ url: "/map3d-theme.js" });
  await page.evaluate(
    () =>
      new Promise<void>((done) => {
        const g = globalThis as unknown as Theming;
        g.theme = new g.map3d.theme(g.layer, "measuredHeight", { language: "de", others: "hidden" }).addTo(g.map);
        g.theme.once("ready", () => {
          g.map.once("idle", () => {
            done();
          });
        });
      }),
  );
  expect(await page.locator(".map3d-legend").count()).toBe(1);
  const painted = await picture(page);
  expect(painted.equals(before)).toBe(false);
  await page.screenshot({ path: `${OUT}/theme.png` });
  expect(await page.evaluate(() => (globalThis as unknown as Theming).theme.classes.map(({ ids }) => ids))).toEqual([
    [GROUND],
    [SCHOOL],
    [CHAPEL],
    [HALL],
    [TOWER],
  ]);
  await page.locator(".map3d-legend button").nth(3).click();
  await page.waitForFunction(async () => (await (globalThis as Global).map.objectsInView()).length === 1);
  await page.locator(".map3d-legend button").nth(3).click();
  await page.waitForFunction(async () => (await (globalThis as Global).map.objectsInView()).length === 5);
  await settled(
    page,
    () => {
      (globalThis as unknown as Theming).theme.remove();
    },
    null,
  );
  expect(before.equals(await picture(page))).toBe(true);
  expect(await page.locator(".map3d-legend").count()).toBe(0);
  const failed = await page.evaluate(
    () =>
      new Promise<string>((done) => {
        const g = globalThis as unknown as Theming;
        g.map.on("error", ({ error }) => {
          done(error.message);
        });
        new g.map3d.theme(g.layer, "height").addTo(g.map);
      }),
  );
  expect(failed).toBe('no attribute "height"; the rendering has class, listed, measuredHeight, note, roofType');
  expect(problems).toEqual([]);
});

/** Replaces a column by a summary and shards. Returns its name. */
function divideColumn(files: Map<string, Uint8Array>, name: string): string {
  const read = (path: string): unknown => JSON.parse(new TextDecoder().decode(files.get(path)));
  const write = (path: string, value: unknown): unknown => files.set(path, new TextEncoder().encode(JSON.stringify(value)));
  const { attributes } = read("objects/attributes.json") as { attributes: { name: string; column: string }[] };
  const column = attributes.find((row) => row.name === name)?.column ?? "";
  const whole = read(`objects/columns/${column}.json`) as { ids: number[]; values: number[] };
  const shards = [...new Set(whole.ids.map((id) => Math.floor(id / 1024)))];
  for (const shard of shards) {
    const rows = whole.ids.flatMap((id, k) => (Math.floor(id / 1024) === shard ? [[id, whole.values[k] as number] as const] : []));
    write(`objects/columns/${column}/${String(shard)}.json`, {
      map3d: "column",
      version: 1,
      name,
      of: "attributes",
      shard,
      ids: rows.map(([id]) => id),
      values: rows.map(([, value]) => value),
    });
  }
  const numbers = [...whole.values].sort((a, b) => a - b);
  write(`objects/columns/${column}.json`, {
    map3d: "column",
    version: 2,
    name,
    of: "attributes",
    shard_size: 1024,
    shards,
    objects: numbers.length,
    values: numbers.map((value) => [value, 1]),
    numbers,
  });
  return column;
}

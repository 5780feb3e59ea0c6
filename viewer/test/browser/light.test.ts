import { describe, expect, test } from "vitest";
import { DAY, NOON, PATTERN, withBakedLight } from "../fixture/baked";
import { renderTown } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { loaded, OUT } from "./browser";
import { cosine, decodedLevel, litByte, placeOf, spread, type Shares } from "./level";
import { pixels, settled, type Global } from "./page";
import type { Light } from "../../src/map3d";

const town = renderTown();

const bed = new TestBed({ town: withBakedLight(town), plain: town });
const undrawn = new TestBed(bed.server, { draws: false });

const BETWEEN = { azimuth_deg: 110 + 0.3 * 25, elevation_deg: 35.6 };
/** Weight of DAY[2], computed by the map itself in a unit test; here to byte precision. */
const bits =
  (share: number) =>
  (x: number, y: number): number => {
    const value = PATTERN.sun16(x, y);
    return ((value >> 1) & 1) * (1 - share) + ((value >> 2) & 1) * share;
  };
const all = (): number => 1;
type Share = (x: number, y: number) => number;
type Row = [name: string, towards: { azimuth_deg: number; elevation_deg: number }, more: Partial<Light>, sky: Share, sun: Share];
const RGB: Partial<Light> = { sun_rgb: [1, 0.7, 0.4], sky_rgb: [0.5, 0.6, 1] };

describe("rendered light dims lit pixels one by one", () => {
  const noon = { azimuth_deg: NOON.azimuth_deg, elevation_deg: NOON.elevation_deg };
  const hour = { azimuth_deg: DAY[1]?.azimuth_deg ?? 0, elevation_deg: DAY[1]?.elevation_deg ?? 0 };
  const rows: Row[] = [
    ["the sun's own layer", noon, { occlusion: false }, all, (x: number, y: number) => PATTERN.sun(x, y) / 255],
    ["an hour of the day", hour, { occlusion: false }, all, bits(0)],
    ["occlusion alone", noon, { shadows: false }, (x: number, y: number) => PATTERN.ao(x, y) / 255, all],
    ["shadows and occlusion in colours", hour, RGB, (x: number, y: number) => PATTERN.ao(x, y) / 255, bits(0)],
    ["no layer for another sun", { azimuth_deg: 300, elevation_deg: 30 }, { occlusion: false }, all, all],
  ];
  test.each(rows.flatMap((row) => (["webgl", "canvas"] as const).map((drawer) => [drawer, ...row] as const)))(
    "%s: %s",
    async (drawer, _, towards, more, skyAt, sunAt) => {
      const light = { ambient: 0.3, diffuse: 0.6, sun_rgb: [1, 1, 1], sky_rgb: [1, 1, 1], ...towards, ...more };
      const { page } = await bed.start("town", { zoom: 3, light, drawer });
      const got = await pixels(page);
      const [color, normal] = [decodedLevel(town, "color"), decodedLevel(town, "normal")];
      const [left, top] = await placeOf(page);
      const shares = (x: number, y: number): Shares | null => {
        const stored = normal(x, y);
        const cos = stored && cosine(stored, light);
        return cos === undefined || cos === null ? null : [skyAt(x, y), cos * sunAt(x, y)];
      };
      const wrong: string[] = [];
      let compared = 0;
      for (let at = 0; at < 800 * 600; at += 7) {
        const [x, y] = [(at % 800) - left, Math.floor(at / 800) - top];
        const c = color(x, y);
        if (!c || c[3] === 0) continue;
        compared++;
        const own = shares(x, y);
        const [sky, sun] = own ? spread(own, [shares(x - 1, y), shares(x + 1, y), shares(x, y - 1), shares(x, y + 1)]) : [1, 0.5];
        const want = [0, 1, 2].map((k) =>
          litByte(c[k] ?? 0, light.ambient * (light.sky_rgb[k] ?? 0) * sky + light.diffuse * (light.sun_rgb[k] ?? 0) * sun),
        );
        if (want.some((value, k) => Math.abs(value - (got[4 * at + k] ?? 0)) > 1))
          wrong.push(`${String(x)}, ${String(y)}: ${String(want)} is ${String([...got.subarray(4 * at, 4 * at + 3)])}`);
      }
      expect(wrong.slice(0, 5)).toEqual([]);
      expect(compared).toBeGreaterThan(8_000);
    },
  );
});

test("a time between two hours shows a picture between theirs", async () => {
  const { page, problems } = await bed.start("town", { zoom: 3, light: { ...BETWEEN, occlusion: false } });
  await page.screenshot({ path: `${OUT}/between.png` });
  const mixed = await pixels(page);
  await settled(page, () => (globalThis as Global).map.setLight({ shadows: false }), null);
  const bright = await pixels(page);
  const darker = mixed.filter((value, at) => at % 4 < 3 && value < (bright[at] ?? 0) - 2).length;
  const brighter = mixed.filter((value, at) => at % 4 < 3 && value > (bright[at] ?? 0) + 1).length;
  expect(darker).toBeGreaterThan(30_000);
  expect(brighter).toBe(0);
  expect(problems).toEqual([]);
});

test("tiles of light are requested only when shown, after colour and normals", async () => {
  bed.server.requests.length = 0;
  const { page } = await undrawn.start("town", { light: { shadows: false, occlusion: false } });
  expect(bed.server.requests.filter((url) => /\/(noon|day|ao)\//.test(url))).toEqual([]);
  await settled(page, (light) => (globalThis as Global).map.setLight(light), { shadows: true, azimuth_deg: 200, elevation_deg: 50 });
  const asked = bed.server.requests.filter((url) => /\/(noon|day|ao)\//.test(url));
  expect(asked.length).toBeGreaterThan(0);
  expect(asked.every((url) => url.includes("/noon/"))).toBe(true);
});

test("setTime lights the scene by the sun; setting an azimuth ends it", async () => {
  const { page } = await bed.start("plain");
  const [noon, time] = await page.evaluate(() => {
    const { map } = globalThis as Global;
    map.setTime(new Date("2026-06-21T11:15:00Z"));
    return [map.light, map.time?.toISOString()] as const;
  });
  expect(time).toBe("2026-06-21T11:15:00.000Z");
  expect(noon.elevation_deg).toBeCloseTo(65.3, 1);
  expect(noon.azimuth_deg).toBeGreaterThan(176);
  expect(noon.azimuth_deg).toBeLessThan(180);
  const bright = await pixels(page);
  await settled(page, () => (globalThis as Global).map.setTime(new Date("2026-06-21T22:30:00Z")), null);
  await page.screenshot({ path: `${OUT}/night.png` });
  const dark = await pixels(page);
  const mean = (bytes: Buffer, k: number): number => bytes.reduce((sum, value, at) => sum + (at % 4 === k ? value : 0), 0);
  expect(mean(dark, 0)).toBeLessThan(0.65 * mean(bright, 0));
  expect(mean(dark, 2) / mean(dark, 0)).toBeGreaterThan(1.2 * (mean(bright, 2) / mean(bright, 0)));
  expect(await page.evaluate(() => (globalThis as Global).map.setLight({ azimuth_deg: 10 }).time)).toBeNull();
});

test("positions convert to longitude and latitude, and back", async () => {
  const { page } = await undrawn.start("plain");
  const [there, back] = await page.evaluate(() => {
    const { map } = globalThis as Global;
    const lonLat = map.lonLat([691012, 5335950, 510]);
    return [lonLat, lonLat && map.fromLonLat(lonLat)] as const;
  });
  expect(there?.[0]).toBeCloseTo(11.5680891, 5);
  expect(back?.[0]).toBeCloseTo(691012, 3);
  expect(back?.[1]).toBeCloseTo(5335950, 3);
});

test.each(["webgl", "canvas"])(
  "%s: on a dense screen, light comes from the level above, in fewer requests, and looks the same from afar",
  async (drawer) => {
    const pictures: Uint8ClampedArray[] = [];
    const counts: number[] = [];
    for (const deviceScaleFactor of [1, 2]) {
      bed.server.requests.length = 0;
      const { page, problems } = await bed.start(
        "town",
        { zoom: deviceScaleFactor === 1 ? 3 : 2, light: { azimuth_deg: 110, elevation_deg: 33, shadows: false }, drawer },
        {},
        { viewport: { width: 800 / deviceScaleFactor, height: 600 / deviceScaleFactor }, deviceScaleFactor },
      );
      await loaded(page);
      const levels = (layer: string): Set<string> =>
        new Set(bed.server.requests.flatMap((url) => new RegExp(`/town/[^/]+/${layer}/(\\d+)/`).exec(url)?.[1] ?? []));
      const deepest = Math.max(...[...levels("color")].map(Number));
      expect(Math.max(...[...levels("ao")].map(Number))).toBe(deviceScaleFactor === 1 ? deepest : deepest - 1);
      const light = bed.server.requests.filter((url) => url.includes("/ao/"));
      expect(new Set(light).size).toBe(light.length);
      counts.push(light.length);
      pictures.push(Uint8ClampedArray.from(await pixels(page)));
      expect(problems).toEqual([]);
      await page.context().close();
    }
    expect(counts).toEqual([20, 10]);
    const mean = (data: Uint8ClampedArray): number => data.reduce((sum, value) => sum + value, 0) / data.length;
    expect(pictures[0]?.length).toBe(pictures[1]?.length);
    expect(Math.abs(mean(pictures[0] as Uint8ClampedArray) - mean(pictures[1] as Uint8ClampedArray))).toBeLessThan(2);
  },
);

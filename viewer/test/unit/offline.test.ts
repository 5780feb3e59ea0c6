import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { describe, expect, test } from "vitest";
import { PAGE_FILES } from "../../page/offline";
import { projectedBox } from "../../src/geo/camera";
import { tileName, type Tile } from "../../src/geo/frame";
import { readManifest } from "../../src/geo/manifest";
import { isVersioned, pageKey, rangeResponse, rangeKey, rangeOf } from "../../src/offline/cacheKeys";
import { resolveOptions, tilesIn, tilesOf, type AreaOptions } from "../../src/offline/areaPlan";
import type { Map3D } from "../../src/map3d";
import { findCover, type Rect } from "../../src/tiles/cover";
import { ORIGIN } from "../fixture/town";
import { renderTown } from "../fixture/rendering";

const town = readManifest(renderTown(16, 0.76).json, "town");
const every = (zmax: number): Tile[] =>
  Array.from({ length: zmax + 1 }, (_, z) =>
    Array.from({ length: 4 ** z }, (__, k) => ({ z, x: k % 2 ** z, y: Math.floor(k / 2 ** z) })),
  ).flat();
const names = (tiles: Iterable<Tile>): string[] => [...tiles].map(tileName).sort();

/** Returns the same sequence of numbers each time. */
function* random(seed: number): Generator<number, never> {
  for (let state = seed; ;) {
    state = (state * 1103515245 + 12345) % 2 ** 31;
    yield state / 2 ** 31;
  }
}

/** A map that shows the town. */
const shown = {
  layers: [{ rendering: town }],
  container: { clientWidth: 100, clientHeight: 50 },
  unproject: () => [ORIGIN[0], ORIGIN[1] + 20, ORIGIN[2] - 2],
  pick: () => Promise.resolve({ position: [ORIGIN[0], ORIGIN[1], ORIGIN[2] - 2 + 20] }),
  metresPerPixel: 0.1,
} as unknown as Map3D;
const planned = async (options: AreaOptions): Promise<string[]> =>
  [...tilesOf(town, await resolveOptions(shown, options))]
    .map(({ view, layer, tile }) => `${view.id}/${layer.name}/${tileName(tile)}`)
    .sort();

describe("tiles of an area", () => {
  const views = [...town.views.values()];

  test("equal a brute-force search over all tiles, for any rectangle and levels", () => {
    const next = random(7);
    for (let round = 0; round < 200; round++) {
      const view = views[round % views.length];
      if (!view) throw new Error("the town has views");
      const { frame, occupancy } = view;
      const [u, v] = [frame.u0 + frame.size * (next.next().value * 1.2 - 0.1), frame.v0 - frame.size * (next.next().value * 1.2 - 0.1)];
      const [w, h] = [frame.size * next.next().value ** 3, frame.size * next.next().value ** 3];
      const rect: Rect = [
        [u, v - h],
        [u + w, v],
      ];
      const least = Math.floor(next.next().value * 3);
      const levels = [least, least + Math.floor(next.next().value * 6)] as const;
      const brute = every(frame.zmax).filter(
        (tile) =>
          tile.z >= levels[0] &&
          tile.z <= levels[1] &&
          occupancy.has(tile) &&
          (tile.z <= 1 || findCover(frame, () => true, tile.z, rect).some((other) => other.x === tile.x && other.y === tile.y)),
      );
      expect(names(tilesIn(view, rect, levels))).toEqual(names(brute));
    }
  });

  test("are all occupied tiles for the whole scene, and the first levels for an empty area", () => {
    for (const view of views) {
      const { frame, occupancy } = view;
      const whole: Rect = [
        [frame.u0, frame.v0 - frame.size],
        [frame.u0 + frame.size, frame.v0],
      ];
      expect(names(tilesIn(view, whole, [0, 26]))).toEqual(names(every(frame.zmax).filter((tile) => occupancy.has(tile))));
      const nothing: Rect = [
        [frame.u0 - 10, frame.v0 + 5],
        [frame.u0 - 5, frame.v0 + 10],
      ];
      expect(names(tilesIn(view, nothing, [0, 26]))).toEqual(names(every(1).filter((tile) => occupancy.has(tile))));
    }
  });

  test("match the requested layers, directions and levels; by default the view from all directions", async () => {
    const bounds = [
      [ORIGIN[0] + 24, ORIGIN[1] + 18, ORIGIN[2]],
      [ORIGIN[0] + 40, ORIGIN[1] + 34, ORIGIN[2] + 62],
    ] as const;
    const few = await planned({ bounds, layers: ["id"], directions: ["90-45"], levels: [3, 3] });
    const view = town.views.get("90-45");
    const rect = projectedBox((view as (typeof views)[0]).frame, [
      [24, 18, 0],
      [40, 34, 62],
    ]);
    expect(few).toEqual(
      findCover((view as (typeof views)[0]).frame, (tile) => view?.occupancy.has(tile) === true, 3, rect)
        .map((tile) => `90-45/id/${tileName(tile)}`)
        .sort(),
    );
    expect(await planned({ bounds })).toHaveLength(new Set(await planned({ bounds })).size);
    expect(new Set((await planned({})).map((name) => name.split("/").slice(0, 2).join("/"))).size).toBe(16);
    expect((await planned({})).length).toBeLessThan(
      (
        await planned({
          bounds: [
            [0, 0, 0],
            [1e7, 1e7, 1e4],
          ],
        })
      ).length,
    );
    // A point 20 m above the ground at 45 degrees: beside 10 m by 5 m / sin 45°, ground 20 m to each side.
    // Looking there from the south at the ground, if the surface is not known: 20 m further north, which is seen from the side, too.
    const around = 20 + 2.5 * Math.SQRT2;
    expect(
      (await resolveOptions(shown, {})).bounds
        .flat()
        .map((part, k) => part - (ORIGIN[k % 3] ?? 0))
        .map((part) => Number(part.toFixed(3))),
    ).toEqual([-around, -around, -2, around, 25, 62].map((part) => Number(part.toFixed(3))));
    for (const view of views) {
      const { axes } = view.frame;
      const [u, v] = [axes.right[2] * 18, axes.up[2] * 18];
      const rect: Rect = [
        [u - 5, v - 2.5],
        [u + 5, v + 2.5],
      ];
      const kept = new Set(await planned({ directions: [view.id], layers: ["id"] }));
      for (const { z, x, y } of findCover(view.frame, (tile) => view.occupancy.has(tile), view.frame.zmax, rect))
        expect(kept.has(`${view.id}/id/${String(z)}/${String(x)}/${String(y)}`)).toBe(true);
    }
    expect(
      await planned({
        bounds: [
          [0, 0, 0],
          [10, 10, 10],
        ],
      }),
    ).toEqual([]);
  });

  test.each<[AreaOptions, RegExp]>([
    [{ layers: ["colour"] }, /unknown layer "colour"; the map has color, normal, id, depth/],
    [{ directions: ["1-2"] }, /unknown direction "1-2"; the map has 0-45/],
    [{ levels: [4, 2] }, /levels must be a range from 0 upwards, got 4 to 2/],
  ])("%o is refused", async (options, message) => {
    await expect(resolveOptions(shown, options)).rejects.toThrow(message);
  });

  test("a map without a manifest is an error", async () => {
    await expect(resolveOptions({ layers: [] } as unknown as Map3D, {})).rejects.toThrow(/is not ready/);
  });
});

test("the page saves all modules that it imports", () => {
  const folder = join(import.meta.dirname, "../../page");
  const imported = readdirSync(folder)
    .filter((file) => file.endsWith(".ts"))
    .flatMap((file) =>
      [
        ...readFileSync(join(folder, file), "utf8").matchAll(
          /import (?!type)[^;]*?"\.\/(map3d[\w-]*\.module\.js)"|import\("\.\/([\w-]*(?:\.module)?\.js)"\)/g,
        ),
      ].map(([, fixed, later]) => fixed ?? later),
    );
  const links = [...readFileSync(join(folder, "index.html"), "utf8").matchAll(/(?:href|src)="([\w.-]+\.(?:js|css))"/g)].map(
    ([, file]) => file,
  );
  expect([...PAGE_FILES].sort()).toEqual([...new Set([...imported, ...links])].sort());
});

describe("keys", () => {
  test("of ranges, versioned tiles and pages", async () => {
    expect(rangeKey("https://h/a.pmtiles", "0-9")).toBe("https://h/a.pmtiles?map3d-range=0-9");
    expect(rangeKey("https://h/a?b", "0-9")).toBe("https://h/a?b&map3d-range=0-9");
    expect([rangeOf(new Headers({ Range: "bytes=5-8" })), rangeOf(new Headers({ Range: "bytes=5-" })), rangeOf(new Headers())]).toEqual([
      "5-8",
      undefined,
      undefined,
    ]);
    expect(["https://h/0/0/0?v=3", "https://h/0/0/0", "https://h/x?v=a", "https://h/?v=3#x"].map(isVersioned)).toEqual([
      true,
      false,
      false,
      false,
    ]);
    expect([pageKey("https://h/town/index.html?rendering=x#1"), pageKey("https://h/town/"), pageKey("https://h/a.html?x")]).toEqual([
      "https://h/town/",
      "https://h/town/",
      "https://h/a.html",
    ]);
    const part = await rangeResponse(new Response("abcd", { headers: { "content-type": "x/y" } }), "10-99");
    expect([part.status, part.headers.get("content-range"), await part.text()]).toEqual([206, "bytes 10-13/*", "abcd"]);
  });
});

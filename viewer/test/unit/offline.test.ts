import { describe, expect, test } from "vitest";
import type { Vec2 } from "../../src/core/vec";
import { projectedBox } from "../../src/geo/camera";
import { tileName, type Tile } from "../../src/geo/frame";
import { readManifest } from "../../src/geo/manifest";
import { isVersioned, pageKey, partOf, pieceKey, rangeOf } from "../../src/offline/keys";
import { filled, tilesIn, tilesOf, type AreaOptions } from "../../src/offline/plan";
import type { map } from "../../src/map3d";
import { coverOf, type Rect } from "../../src/tiles/cover";
import { ORIGIN } from "../fixture/town";
import { renderTown } from "../fixture/rendering";

const town = readManifest(renderTown(16, 0.76).json, "town");
const every = (zmax: number): Tile[] => Array.from({ length: zmax + 1 }, (_, z) => Array.from({ length: 4 ** z }, (__, k) => ({ z, x: k % 2 ** z, y: Math.floor(k / 2 ** z) }))).flat();
const names = (tiles: Iterable<Tile>): string[] => [...tiles].map(tileName).sort();

/** The same numbers each time. */
function* random(seed: number): Generator<number, never> {
  for (let state = seed; ;) {
    state = (state * 1103515245 + 12345) % 2 ** 31;
    yield state / 2 ** 31;
  }
}

/** A map that shows the town. */
const shown = { layers: [{ rendering: town }], container: { clientWidth: 100, clientHeight: 50 }, unproject: ([x, y]: Vec2) => [ORIGIN[0] + x / 10, ORIGIN[1] - y / 10, ORIGIN[2] - 2] } as unknown as map;
const planned = (options: AreaOptions): string[] => [...tilesOf(town, filled(shown, options))].map(({ view, layer, tile }) => `${view.id}/${layer.name}/${tileName(tile)}`).sort();

describe("tiles of an area", () => {
  const views = [...town.views.values()];

  test("are those that a brute force over all tiles finds, for any rectangle and levels", () => {
    const next = random(7);
    for (let round = 0; round < 200; round++) {
      const view = views[round % views.length];
      if (!view) throw new Error("the town has views");
      const { frame, occupancy } = view;
      const [u, v] = [frame.u0 + frame.size * (next.next().value * 1.2 - 0.1), frame.v0 - frame.size * (next.next().value * 1.2 - 0.1)];
      const [w, h] = [frame.size * next.next().value ** 3, frame.size * next.next().value ** 3];
      const rect: Rect = [[u, v - h], [u + w, v]];
      const least = Math.floor(next.next().value * 3);
      const levels = [least, least + Math.floor(next.next().value * 6)] as const;
      const brute = every(frame.zmax).filter((tile) => tile.z >= levels[0] && tile.z <= levels[1] && occupancy.has(tile) && (tile.z <= 1 || coverOf(frame, () => true, tile.z, rect).some((other) => other.x === tile.x && other.y === tile.y)));
      expect(names(tilesIn(view, rect, levels))).toEqual(names(brute));
    }
  });

  test("of everything are all occupied tiles, of nothing the first levels", () => {
    for (const view of views) {
      const { frame, occupancy } = view;
      const whole: Rect = [[frame.u0, frame.v0 - frame.size], [frame.u0 + frame.size, frame.v0]];
      expect(names(tilesIn(view, whole, [0, 26]))).toEqual(names(every(frame.zmax).filter((tile) => occupancy.has(tile))));
      const nothing: Rect = [[frame.u0 - 10, frame.v0 + 5], [frame.u0 - 5, frame.v0 + 10]];
      expect(names(tilesIn(view, nothing, [0, 26]))).toEqual(names(every(1).filter((tile) => occupancy.has(tile))));
    }
  });

  test("are of the layers, directions and levels that were asked for; without words those of the ground in view", () => {
    const bounds = [[ORIGIN[0] + 24, ORIGIN[1] + 18, ORIGIN[2]], [ORIGIN[0] + 40, ORIGIN[1] + 34, ORIGIN[2] + 62]] as const;
    const few = planned({ bounds, layers: ["id"], directions: ["90-45"], levels: [3, 3] });
    const view = town.views.get("90-45");
    const rect = projectedBox((view as (typeof views)[0]).frame, [[24, 18, 0], [40, 34, 62]]);
    expect(few).toEqual(coverOf((view as (typeof views)[0]).frame, (tile) => view?.occupancy.has(tile) === true, 3, rect).map((tile) => `90-45/id/${tileName(tile)}`).sort());
    expect(planned({ bounds })).toHaveLength(new Set(planned({ bounds })).size);
    expect(new Set(planned({}).map((name) => name.split("/").slice(0, 2).join("/"))).size).toBe(16);
    expect(planned({}).length).toBeLessThan(planned({ bounds: [[0, 0, 0], [1e7, 1e7, 1e4]] }).length);
    expect(filled(shown, {}).bounds).toEqual([[ORIGIN[0], ORIGIN[1] - 5, ORIGIN[2] - 2], [ORIGIN[0] + 10, ORIGIN[1], ORIGIN[2] + 62]]);
    expect(planned({ bounds: [[0, 0, 0], [10, 10, 10]] })).toEqual([]);
  });

  test.each<[AreaOptions, RegExp]>([
    [{ layers: ["colour"] }, /"colour" is none of the map's layers: color, normal, id, depth/],
    [{ directions: ["1-2"] }, /"1-2" is none of the map's directions: 0-45/],
    [{ levels: [4, 2] }, /levels go from 0 upwards, got 4 to 2/],
  ])("%o is refused", (options, message) => {
    expect(() => filled(shown, options)).toThrow(message);
  });

  test("a map without a manifest is refused", () => {
    expect(() => filled({ ...shown, layers: [] } as unknown as map, {})).toThrow(/shows nothing yet/);
  });
});

describe("keys", () => {
  test("pieces, versions and pages", async () => {
    expect(pieceKey("https://h/a.pmtiles", "0-9")).toBe("https://h/a.pmtiles?map3d-range=0-9");
    expect(pieceKey("https://h/a?b", "0-9")).toBe("https://h/a?b&map3d-range=0-9");
    expect([rangeOf(new Headers({ Range: "bytes=5-8" })), rangeOf(new Headers({ Range: "bytes=5-" })), rangeOf(new Headers())]).toEqual(["5-8", undefined, undefined]);
    expect(["https://h/0/0/0?v=3", "https://h/0/0/0", "https://h/x?v=a", "https://h/?v=3#x"].map(isVersioned)).toEqual([true, false, false, false]);
    expect([pageKey("https://h/town/index.html?rendering=x#1"), pageKey("https://h/town/"), pageKey("https://h/a.html?x")]).toEqual(["https://h/town/", "https://h/town/", "https://h/a.html"]);
    const part = await partOf(new Response("abcd", { headers: { "content-type": "x/y" } }), "10-99");
    expect([part.status, part.headers.get("content-range"), await part.text()]).toEqual([206, "bytes 10-13/*", "abcd"]);
  });
});

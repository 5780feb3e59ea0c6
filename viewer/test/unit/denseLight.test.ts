import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";
import { ancestor, type Tile } from "../../src/geo/frame";
import type { LayerInfo, View } from "../../src/geo/manifest";
import { Cache } from "../../src/tiles/cache";
import type { Decoder } from "../../src/tiles/decoder";
import { enlargeQuarter } from "../../src/tiles/enlargeQuarter";
import { LayerTiles, type CachedTile } from "../../src/tiles/layerTiles";
import { RequestQueue } from "../../src/tiles/queue";
import type { Source } from "../../src/tiles/source";

const SIDE = 8;
const QUARTERS: readonly Tile[] = [
  { z: 3, x: 4, y: 6 },
  { z: 3, x: 5, y: 6 },
  { z: 3, x: 4, y: 7 },
  { z: 3, x: 5, y: 7 },
];
const enlarge = (values: Uint8Array<ArrayBuffer>, tile: Tile): Uint8Array =>
  enlargeQuarter({ kind: "ao", width: SIDE, height: SIDE, values }, tile).values;
const enlargeBits = (rows: readonly string[], tile: Tile): string[] => {
  const values = Uint16Array.from(rows.join(""), (letter) => (letter === "#" ? 0x8001 : 0));
  const found = [...enlargeQuarter({ kind: "sun16", width: SIDE, height: SIDE, values }, tile).values]
    .map((value) => ({ 0x8001: "#", 0: "." })[value] ?? "?")
    .join("");
  return Array.from({ length: SIDE }, (_, row) => found.slice(row * SIDE, (row + 1) * SIDE));
};
const [TOP_LEFT, , , BOTTOM_RIGHT] = QUARTERS as [Tile, Tile, Tile, Tile];

describe("a quarter of a tile of light, enlarged", () => {
  test.each(QUARTERS)("has interpolated shares of light: %o", (tile) => {
    const values = Uint8Array.from({ length: SIDE * SIDE }, (_, at) => (at * 89 + 7 * (at % 5)) % 256);
    const found = enlarge(values, tile);
    // The independent way: bilinear interpolation at the centre of the small pixel, edges repeated.
    const at = (x: number, y: number): number =>
      values[Math.min(Math.max(y, 0), SIDE - 1) * SIDE + Math.min(Math.max(x, 0), SIDE - 1)] ?? NaN;
    for (let j = 0; j < SIDE; j++) {
      for (let i = 0; i < SIDE; i++) {
        const [u, v] = [(i + 0.5 + (tile.x - 4) * SIDE) / 2 - 0.5, (j + 0.5 + (tile.y - 6) * SIDE) / 2 - 0.5];
        const [x, y] = [Math.floor(u), Math.floor(v)];
        const row = (k: number): number => at(x, k) * (1 - u + x) + at(x + 1, k) * (u - x);
        expect(Math.abs((found[j * SIDE + i] ?? NaN) - (row(y) * (1 - v + y) + row(y + 1) * (v - y)))).toBeLessThanOrEqual(0.5);
      }
    }
  });

  test("keeps straight edges and thin lines", () => {
    expect(
      enlargeBits(["##......", "##......", "........", "........", "........", "......#.", "......#.", "......#."], TOP_LEFT).slice(0, 3),
    ).toEqual(["####....", "####....", "####...."]);
    expect(
      enlargeBits(["........", "........", "........", "......#.", "......#.", "......#.", "......#.", "......#."], BOTTOM_RIGHT),
    ).toEqual(new Array(SIDE).fill("....##.."));
  });

  test("halves the steps of slanted edges", () => {
    expect(enlargeBits(["#.......", "##......", "###.....", "####....", "#####...", "######..", "#######.", "########"], TOP_LEFT)).toEqual(
      ["##......", "##......", "###.....", "####....", "#####...", "######..", "#######.", "########"],
    );
  });
});

const VIEW = { id: "0-45", occupancy: { has: () => true } } as unknown as View;
const layerOf = (kind: string): LayerInfo => ({ name: kind, kind, format: "png", media_type: "image/png" });

/** Tiles that are fetched from a source which notes what it is asked for. */
function open(): { tiles: LayerTiles; asked: string[]; decoded: string[] } {
  const [asked, decoded]: [string[], string[]] = [[], []];
  const name = ({ z, x, y }: Tile): string => [z, x, y].join("/");
  const source = {
    tile: (_: unknown, { kind }: LayerInfo, tile: Tile) => {
      asked.push(`${kind} ${name(tile)}`);
      return Promise.resolve(new ArrayBuffer(9));
    },
  } as unknown as Source;
  const decoder = {
    decode: (kind: string, _: string, bytes: ArrayBuffer, keep: boolean, below?: Tile) => {
      decoded.push(`${kind} ${String(bytes.byteLength)} ${String(keep)} ${below ? name(below) : ""}`);
      return Promise.resolve({ kind, width: 1, height: 1, values: new Uint8Array(1) });
    },
  } as unknown as Decoder;
  const tiles = new LayerTiles(
    "layer0",
    source,
    { cache: new Cache<CachedTile>(1e6, () => undefined), queue: new RequestQueue(12), decoder },
    () => undefined,
  );
  return { tiles, asked, decoded };
}

describe("on a dense screen", () => {
  beforeEach(() => {
    vi.stubGlobal("devicePixelRatio", 3);
  });
  afterEach(() => {
    vi.unstubAllGlobals();
  });

  test("four tiles of light are made from the tile above, which is fetched once and kept for later", async () => {
    const { tiles, asked, decoded } = open();
    const above = ancestor(TOP_LEFT, 1);
    await Promise.all(QUARTERS.slice(0, 3).map((tile) => tiles.fetch(VIEW, layerOf("sun16"), tile)));
    await tiles.fetch(VIEW, layerOf("sun16"), BOTTOM_RIGHT);
    expect(asked).toEqual([`sun16 ${[above.z, above.x, above.y].join("/")}`]);
    expect(decoded.sort()).toEqual(["sun16 9 true 3/4/6", "sun16 9 true 3/4/7", "sun16 9 true 3/5/6", "sun16 9 true 3/5/7"]);
  });

  test("the whole of a pyramid's top, and tiles of other kinds, are shown as they are", async () => {
    const { tiles, asked, decoded } = open();
    await tiles.fetch(VIEW, layerOf("ao"), { z: 0, x: 0, y: 0 });
    await tiles.fetch(VIEW, layerOf("normal"), TOP_LEFT);
    expect(asked).toEqual(["ao 0/0/0", "normal 3/4/6"]);
    expect(decoded).toEqual(["ao 9 false ", "normal 9 false "]);
  });
});

test("on other screens, light is shown as it is", async () => {
  vi.stubGlobal("devicePixelRatio", 1.25);
  const { tiles, asked } = open();
  for (const kind of ["ao", "sun", "sun16"]) await tiles.fetch(VIEW, layerOf(kind), TOP_LEFT);
  expect(asked).toEqual(["ao 3/4/6", "sun 3/4/6", "sun16 3/4/6"]);
  vi.unstubAllGlobals();
});

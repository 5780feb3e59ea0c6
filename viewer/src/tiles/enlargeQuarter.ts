import { clamp } from "../core/vec";
import type { Tile } from "../geo/frame";
import type { TileData } from "./tileData";

/** Tiles that can be shown from the tile above. */
export type EnlargedData = Extract<TileData, { readonly kind: "sun" | "ao" | "sun16" }>;

/**
 * Computes a tile from the tile above, of which it covers a quarter. Shares of light are interpolated. Bits, which have no values
 * between them, are those of the nearest pixel, but light loses its corners, so that slanted edges of shadows have steps of half the size.
 */
export function enlargeQuarter<Data extends EnlargedData>(data: Data, tile: Tile): Data {
  const { kind, width, height, values } = data;
  const enlarged = values.map((_, at) => {
    const read = (x: number, y: number): number => values[clamp(y >> 1, 0, height - 1) * width + clamp(x >> 1, 0, width - 1)] as number;
    const [x, y] = [(at % width) + (tile.x % 2) * width, Math.floor(at / width) + (tile.y % 2) * height];
    const [side, beyond] = [x + (x % 2) * 4 - 2, y + (y % 2) * 4 - 2];
    const [own, a, b, c] = [read(x, y), read(side, y), read(x, beyond), read(side, beyond)];
    return kind === "sun16" ? own & (a | b | c) : (9 * own + 3 * (a + b) + c + 8) >> 4;
  });
  return { ...data, values: enlarged };
}

import { clamp } from "../core/vec";
import type { Tile } from "../geo/frame";

/**
 * Computes the pixels of a tile of light from those of the tile above, of which it covers a quarter. Shares of light are interpolated. Bits, which have
 * no values between them, are those of the nearest pixel, but light loses its corners, so that slanted edges of shadows have steps of half the size.
 */
export function enlargeQuarter<Values extends Uint8Array | Uint16Array>(values: Values, width: number, height: number, tile: Tile, isBits: boolean): Values {
  const read = (x: number, y: number): number => values[clamp(y, 0, height - 1) * width + clamp(x, 0, width - 1)] as number;
  return values.map((_, at) => {
    const [i, j] = [(at % width) + (tile.x % 2) * width, Math.floor(at / width) + (tile.y % 2) * height];
    const [x, y, side, beyond] = [i >> 1, j >> 1, (i >> 1) + (i % 2) * 2 - 1, (j >> 1) + (j % 2) * 2 - 1];
    const [own, a, b, c] = [read(x, y), read(side, y), read(x, beyond), read(side, beyond)];
    return isBits ? own & (a | b | c) : (9 * own + 3 * (a + b) + c + 8) >> 4;
  }) as Values;
}

import type { Frame, Tile } from "../geo/frame";
import type { TileFallback } from "../tiles/cover";
import type { Quad } from "./drawer";

/** The screen's position in a view: U and V of its top left corner, metres per device pixel. */
export interface ScreenPosition {
  readonly left: number;
  readonly top: number;
  readonly px_m: number;
}

/**
 * Places tiles on the screen. An edge has the same coordinate whichever tile or level it is computed for, so quads meet
 * without gaps. Where a tile pixel is a device pixel, edges are rounded to whole pixels, so that colours come out exactly as stored.
 */
export function placeQuads(frame: Frame, screen: ScreenPosition, fallbacks: readonly TileFallback[], level: number): Quad[] {
  const exact = frame.size / 2 ** level / screen.px_m;
  const whole = Math.abs(exact - frame.tilePx) < 1e-4;
  const atLevel = whole ? frame.tilePx : exact;
  const snap = (at: number): number => (whole ? Math.round(at) : at);
  const left = snap((frame.u0 - screen.left) / screen.px_m);
  const top = snap((screen.top - frame.v0) / screen.px_m);
  const side = (z: number): number => atLevel * 2 ** (level - z);
  const corner = ({ z, x, y }: Tile): [number, number] => [left + x * side(z), top + y * side(z)];
  const end = ({ z, x, y }: Tile): [number, number] => [left + (x + 1) * side(z), top + (y + 1) * side(z)];
  return fallbacks.map(({ area, from }) => ({
    from,
    rect: [...corner(area), ...end(area)],
    origin: corner(from),
    scale: frame.tilePx / side(from.z),
  }));
}

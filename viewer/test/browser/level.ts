import type { Page } from "playwright-core";
import type { Fixture } from "../fixture/rendering";
import type { Global } from "./page";

/** Returns a reader of level 3's pixels in view 0-45, as they were before encoding. */
export function decodedLevel(town: Fixture, layer: "color" | "normal" | "id"): (x: number, y: number) => Buffer | undefined {
  const tiles = new Map([...town.raw].map(([path, bytes]) => [path, Buffer.from(bytes)]));
  const size = layer === "normal" ? 3 : 4;
  return (x, y) => {
    const bytes = tiles.get(`0-45/${layer}/3/${String(Math.floor(x / 128))}/${String(Math.floor(y / 128))}`);
    const at = size * (128 * (((y % 128) + 128) % 128) + (((x % 128) + 128) % 128));
    return bytes?.subarray(at, at + size);
  };
}

/** Returns the position of the view's top left corner on the map, CSS pixels. */
export const cornerOf = (page: Page): Promise<[number, number]> =>
  page.evaluate(() => {
    const { map, layer } = globalThis as Global;
    const view = layer.rendering?.views.get(map.direction);
    if (!view) throw new Error("no view");
    const { frame } = view;
    const { right, up } = frame.axes;
    const world = [0, 1, 2].map((k) => (layer.rendering?.json.origin[k] ?? 0) + frame.u0 * (right[k] ?? 0) + frame.v0 * (up[k] ?? 0)) as [
      number,
      number,
      number,
    ];
    return map.project(world) as [number, number];
  });

/** Returns the canvas pixel of level 3's first pixel. */
export const placeOf = async (page: Page): Promise<[number, number]> => {
  const [x, y] = await cornerOf(page);
  return [Math.round(x), Math.round(y)];
};

/** Fractions of skylight and sunlight. */
export type Shares = readonly [sky: number, sun: number];

/** Computes the cosine between a stored normal and the light; null without a normal. */
export function cosine(stored: Uint8Array, { azimuth_deg, elevation_deg }: { azimuth_deg: number; elevation_deg: number }): number | null {
  if (stored.every((part) => part === 0)) return null;
  const [a, h] = [(azimuth_deg * Math.PI) / 180, (elevation_deg * Math.PI) / 180];
  const n = [...stored].map((part) => (part / 255) * 2 - 1);
  const sun = [Math.sin(a) * Math.cos(h), Math.cos(a) * Math.cos(h), Math.sin(h)];
  return Math.max(0, n.reduce((sum, part, k) => sum + part * (sun[k] ?? 0), 0) / Math.hypot(...n));
}

/** Spreads light: half a pixel's own and an eighth of each neighbour's; neighbours without a normal count as the pixel itself. */
export function spread(own: Shares, around: readonly (Shares | null)[]): Shares {
  return [0, 1].map((k) => (own[k] ?? 0) / 2 + around.reduce((sum, beside) => sum + ((beside ?? own)[k] ?? 0), 0) / 8) as unknown as Shares;
}

/** Computes the lit byte of a stored colour byte. */
export function litByte(byte: number, strength: number): number {
  const c = byte / 255;
  const lit = Math.min((c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4) * strength, 1);
  return Math.round(255 * (lit <= 0.0031308 ? 12.92 * lit : 1.055 * lit ** (1 / 2.4) - 0.055));
}

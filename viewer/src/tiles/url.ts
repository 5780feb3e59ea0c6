import { tileName, type Tile } from "../geo/frame";

/** A base URL without its trailing slash; "." and relative ones are taken from `page`. */
export function normalizeBaseUrl(url: string, page: string): string {
  const full = new URL(url === "" ? "." : url, page);
  full.hash = "";
  full.search = "";
  return full.href.replace(/\/+$/, "");
}

/** The host (an index) that serves a tile: always the same one, so that caches work; neighbours differ. */
export const chooseHost = ({ z, x, y }: Tile, hosts: number): number => (x + 2 * y + z) % hosts;

/** `<base>/<view>/<layer>/<z>/<x>/<y>?v=<block version>` */
export function tileUrl(base: string, view: string, layer: string, tile: Tile, version: number): string {
  return `${base}/${view}/${layer}/${tileName(tile)}?v=${String(version)}`;
}

/** All places to ask for a tile, its own host first: the others are asked when that one fails. */
export function tileUrls(bases: readonly string[], view: string, layer: string, tile: Tile, version: number): string[] {
  const first = chooseHost(tile, bases.length);
  return bases.map((_, k) => tileUrl(bases[(first + k) % bases.length] ?? "", view, layer, tile, version));
}

import { tileName, type Tile } from "../geo/frame";

/** Returns an absolute base URL without a trailing slash. @param page base of relative URLs */
export function normalizeBaseUrl(url: string, page: string): string {
  const full = new URL(url === "" ? "." : url, page);
  full.hash = "";
  full.search = "";
  return full.href.replace(/\/+$/, "");
}

/** Chooses the host (an index) of a tile: always the same one, so that caches work; neighbours use different ones. */
export const chooseHost = ({ z, x, y }: Tile, hosts: number): number => (x + 2 * y + z) % hosts;

/** `<base>/<view>/<layer>/<z>/<x>/<y>?v=<block version>` */
export function tileUrl(base: string, view: string, layer: string, tile: Tile, version: number): string {
  return `${base}/${view}/${layer}/${tileName(tile)}?v=${String(version)}`;
}

/** Lists a tile's URLs on all hosts, its own host first, the others as fallbacks. */
export function tileUrls(bases: readonly string[], view: string, layer: string, tile: Tile, version: number): string[] {
  const first = chooseHost(tile, bases.length);
  return bases.map((_, k) => tileUrl(bases[(first + k) % bases.length] ?? "", view, layer, tile, version));
}

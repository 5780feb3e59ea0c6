/** An area's cache is called this and the area's name. */
export const CACHE = "map3d-area:";
/** What an area's cache says of itself lies there. */
export const RECORD = "https://map3d.invalid/area.json";

/** Where a part of a file is kept; `range` as in "0-16383". */
export const pieceKey = (url: string, range: string): string => `${url}${url.includes("?") ? "&" : "?"}map3d-range=${range}`;

/** "0-16383" of a Range header; undefined for anything else. */
export const rangeOf = (headers: Headers): string | undefined => /^bytes=(\d+-\d+)$/.exec(headers.get("range") ?? "")?.[1];

/** Where a page is kept: its address without what follows the path, a folder's page under the folder. */
export function pageKey(url: string): string {
  const { origin, pathname } = new URL(url);
  return origin + pathname.replace(/\/index\.html$/, "/");
}

/** Its bytes never change: tiles of a block's version. */
export const isVersioned = (url: string): boolean => /[?&]v=\d+$/.test(url);

/** Tells two states of a file apart; "" when the host does not say. */
export const tagOf = (headers: Headers): string => headers.get("etag") ?? headers.get("last-modified") ?? "";

/** A kept piece as the answer to a range request. */
export async function partOf(kept: Response, range: string): Promise<Response> {
  const bytes = await kept.arrayBuffer();
  const headers = new Headers(kept.headers);
  const first = Number.parseInt(range, 10);
  headers.set("content-range", `bytes ${String(first)}-${String(first + bytes.byteLength - 1)}/*`);
  return new Response(bytes, { status: 206, headers });
}

/** Prefix of the names of area caches, followed by the area's name. */
export const CACHE = "map3d-area:";
/** Key of the area's record in its cache. */
export const RECORD = "https://map3d.invalid/area.json";

/** Returns the key of a part of a file. @param range such as "0-16383" */
export const rangeKey = (url: string, range: string): string => `${url}${url.includes("?") ? "&" : "?"}map3d-range=${range}`;

/** Returns the range of a Range header, such as "0-16383"; undefined for any other header. */
export const rangeOf = (headers: Headers): string | undefined => /^bytes=(\d+-\d+)$/.exec(headers.get("range") ?? "")?.[1];

/** Returns the key of a page: its URL without query and fragment, and without `index.html`. */
export function pageKey(url: string): string {
  const { origin, pathname } = new URL(url);
  return origin + pathname.replace(/\/index\.html$/, "/");
}

/** Is this the URL of a versioned tile, whose content never changes? */
export const isVersioned = (url: string): boolean => /[?&]v=\d+$/.test(url);

/** Returns the version of a file from its ETag or Last-Modified header; "" when there is none. */
export const tagOf = (headers: Headers): string => headers.get("etag") ?? headers.get("last-modified") ?? "";

/** Converts a cached part to the response of a range request. */
export async function rangeResponse(cached: Response, range: string): Promise<Response> {
  const bytes = await cached.arrayBuffer();
  const headers = new Headers(cached.headers);
  const first = Number.parseInt(range, 10);
  headers.set("content-range", `bytes ${String(first)}-${String(first + bytes.byteLength - 1)}/*`);
  return new Response(bytes, { status: 206, headers });
}

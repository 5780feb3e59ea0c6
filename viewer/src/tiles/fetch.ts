import { FetchError } from "../core/errors";
import { FailedAttempt, isTransientStatus, retry, type RetryOptions } from "../core/retry";

/** The browser's fetch, or a replacement for it. */
export type FetchFunction = (url: string, init: RequestInit) => Promise<Response>;

export interface FetchOptions extends RetryOptions {
  /** First byte and number of bytes. Default: the whole file. */
  range?: readonly [number, number] | undefined;
  /** Passes the browser's cache at once. Default false. */
  reload?: boolean | undefined;
  /** Default: the browser's fetch. */
  fetch?: FetchFunction | undefined;
}

/**
 * Fetches bytes; null for 204 (no content). Retries network errors, 429 and 5xx other than 501 with growing waits, each time at the next
 * of `urls`, and past the browser's cache. Without a network there is one attempt, which a cache may answer.
 * @throws FetchError with the status; the signal's reason when aborted.
 */
export function fetchBytes(urls: readonly string[], options: FetchOptions = {}): Promise<ArrayBuffer | null> {
  return retry(async (failed) => {
    try {
      return await fetchOnce(urls[failed % urls.length] ?? "", options, failed > 0 || options.reload === true);
    } catch (reason) {
      options.signal?.throwIfAborted();
      return new FailedAttempt(reason, isTransient(reason));
    }
  }, options);
}

export async function fetchJson(urls: readonly string[], options: FetchOptions = {}): Promise<unknown> {
  const bytes = await fetchBytes(urls, options);
  if (!bytes) return null;
  try {
    return JSON.parse(new TextDecoder().decode(bytes)) as unknown;
  } catch {
    throw new FetchError(`${urls[0] ?? ""}: not JSON (${String(bytes.byteLength)} bytes)`, 200);
  }
}

/** @param reload bypasses the browser's cache, which may be the cause of the failure */
async function fetchOnce(
  url: string,
  { signal, range, fetch: request = fetch }: FetchOptions,
  reload: boolean,
): Promise<ArrayBuffer | null> {
  const headers: HeadersInit = range ? { Range: `bytes=${String(range[0])}-${String(range[0] + range[1] - 1)}` } : {};
  let response: Response;
  try {
    response = await request(url, { signal: signal ?? null, headers, cache: reload ? "reload" : "default" });
  } catch (reason) {
    const hint = url.startsWith(globalThis.origin) ? "" : "; if the server runs, it has to send the header Access-Control-Allow-Origin: *";
    throw new FetchError(`${url}: no response (${reason instanceof Error ? reason.message : String(reason)})${hint}`);
  }
  const says = (header: string): string => response.headers.get(header) ?? "";
  if (response.status === 204) return null;
  if (!response.ok) throw new FetchError(`${url}: HTTP ${String(response.status)}`, response.status);
  // Some hosts answer so in place of 404.
  if (says("content-type").startsWith("text/html")) throw new FetchError(`${url}: the server sends a web page in place of this file`, 404);
  if (range && response.status !== 206)
    throw new FetchError(
      `${url}: the server ignores range requests (HTTP ${String(response.status)}, expected 206); use nginx, Apache or Caddy`,
      response.status,
    );
  if (range && !/^(identity)?$/.test(says("content-encoding")))
    throw new FetchError(
      `${url}: the server compresses parts of files (Content-Encoding: ${says("content-encoding")}); switch compression off for .pmtiles`,
      response.status,
    );
  const bytes = await response.arrayBuffer();
  // Chromium's cache may end a range early, after another request for it was aborted. The first range may be longer than the file.
  if (range?.[0] && bytes.byteLength !== range[1]) throw new FetchError(`${url}: ${String(bytes.byteLength)} of ${String(range[1])} bytes`);
  return bytes;
}

function isTransient(reason: unknown): boolean {
  const status = reason instanceof FetchError ? reason.status : 0;
  return status === 0 || isTransientStatus(status);
}

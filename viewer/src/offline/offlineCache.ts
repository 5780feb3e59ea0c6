import { Map3dError, type FetchFunction } from "../map3d";
import { isVersioned, pageKey, rangeResponse, rangeKey, rangeOf, tagOf } from "./cacheKeys";

/** The storage is full or not available. */
export class StorageError extends Map3dError {
  override name = "StorageError";
}

/** Headers that do not apply to the stored, decoded body. */
const DROPPED_HEADERS = ["content-encoding", "content-length", "content-range", "vary", "transfer-encoding"];

/** Fetches files through the cache of an area: stores the responses, and does not request unchanged files again. */
export class OfflineCache {
  /** Total size of the files in this run, cached ones included. */
  bytes = 0;
  readonly #cache: Cache;
  readonly #onFailure: (error: StorageError) => void;
  readonly #used = new Set<string>();
  /** Current ETag of each archive, as seen in this run. */
  readonly #tags = new Map<string, string>();
  /** Manifest and page, stored last, so that an incomplete area cannot be opened. */
  readonly #deferred = new Map<string, Response>();

  /** @param onFailure called when the storage is full */
  constructor(cache: Cache, onFailure: (error: StorageError) => void) {
    this.#cache = cache;
    this.#onFailure = onFailure;
  }

  readonly fetch: FetchFunction = async (url, init) => {
    const range = rangeOf(new Headers(init.headers));
    const key = range === undefined ? url : rangeKey(url, range);
    const cached = await this.#cache.match(key);
    if (cached && (isVersioned(url) || this.#same(url, cached))) {
      this.#count(key, cached);
      return range === undefined ? cached : rangeResponse(cached, range);
    }
    const response = await globalThis.fetch(url, isVersioned(url) ? init : { ...init, cache: "reload" });
    if (range !== undefined && response.status === 206) this.#tags.set(url, tagOf(response.headers));
    const whole = range === undefined || response.status === 206;
    return response.ok && whole && !(response.headers.get("cache-control") ?? "").includes("no-store")
      ? this.#store(key, response)
      : response;
  };

  /** Fetches and stores a page or one of its files. @returns the response of the host */
  async savePage(url: string, init: RequestInit): Promise<Response> {
    const response = await globalThis.fetch(url, { ...init, cache: "reload" });
    if (response.ok) await this.#store(isPage(response) ? pageKey(url) : url, response, true);
    return response;
  }

  /** Stores the deferred files and deletes files that this run did not use. */
  async commit(keep: readonly string[]): Promise<void> {
    for (const [key, response] of this.#deferred) await this.#put(key, response);
    for (const request of await this.#cache.keys())
      if (!this.#used.has(request.url) && !keep.includes(request.url)) await this.#cache.delete(request);
  }

  #same(url: string, cached: Response): boolean {
    const tag = tagOf(cached.headers);
    return tag !== "" && tag === this.#tags.get(url);
  }

  #count(key: string, cached: Response): void {
    if (this.#used.has(key)) return;
    this.#used.add(key);
    this.bytes += Number(cached.headers.get("content-length"));
  }

  async #store(key: string, response: Response, deferred = /\/rendering\.json$/.test(key)): Promise<Response> {
    const bytes = await response.arrayBuffer();
    const headers = new Headers(response.headers);
    for (const name of DROPPED_HEADERS) headers.delete(name);
    headers.set("content-length", String(bytes.byteLength));
    const [status, body] = response.status === 204 ? [204, null] : [200, bytes];
    const cached = new Response(body, { status, headers });
    this.#count(key, cached);
    if (deferred) this.#deferred.set(key, cached);
    else await this.#put(key, cached);
    return new Response(body, { status: response.status, headers });
  }

  async #put(key: string, response: Response): Promise<void> {
    try {
      await this.#cache.put(key, response);
    } catch (reason) {
      const error = new StorageError(
        `storage is full: could not save ${key} (${reason instanceof Error ? reason.name : String(reason)}); save a smaller area or delete another one`,
      );
      this.#onFailure(error);
      throw error;
    }
  }
}

const isPage = (response: Response): boolean => (response.headers.get("content-type") ?? "").startsWith("text/html");

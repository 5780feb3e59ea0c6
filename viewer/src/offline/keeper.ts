import { Map3dError, type FetchFunction } from "../map3d";
import { isVersioned, pageKey, partOf, pieceKey, rangeOf, tagOf } from "./keys";

/** The browser has no room for an area, or keeps nothing at all. */
export class StorageError extends Map3dError {
  override name = "StorageError";
}

/** Of an answer whose body is kept as plain bytes. */
const NOT_KEPT = ["content-encoding", "content-length", "content-range", "vary", "transfer-encoding"];

/** Answers requests and keeps the answers in an area's cache; what is kept already, and still the same, is not asked for again. */
export class Keeper {
  /** Of what has been kept, or was. */
  bytes = 0;
  readonly #cache: Cache;
  readonly #failed: (error: StorageError) => void;
  readonly #touched = new Set<string>();
  /** Of archives: their states, as this run has met them. */
  readonly #tags = new Map<string, string>();
  /** Without these nothing opens: they are put last. */
  readonly #held = new Map<string, Response>();

  /** @param failed called when the browser has no room left */
  constructor(cache: Cache, failed: (error: StorageError) => void) {
    this.#cache = cache;
    this.#failed = failed;
  }

  readonly ask: FetchFunction = async (url, init) => {
    const range = rangeOf(new Headers(init.headers));
    const key = range === undefined ? url : pieceKey(url, range);
    const kept = await this.#cache.match(key);
    if (kept && (isVersioned(url) || this.#same(url, kept))) {
      this.#count(key, kept);
      return range === undefined ? kept : partOf(kept, range);
    }
    const answer = await fetch(url, isVersioned(url) ? init : { ...init, cache: "reload" });
    if (range !== undefined && answer.status === 206) this.#tags.set(url, tagOf(answer.headers));
    const whole = range === undefined || answer.status === 206;
    return answer.ok && whole && !(answer.headers.get("cache-control") ?? "").includes("no-store") ? this.#keep(key, answer) : answer;
  };

  /** A page, or a file that it loads. @returns what the host said */
  async page(url: string, init: RequestInit): Promise<Response> {
    const answer = await fetch(url, { ...init, cache: "reload" });
    if (answer.ok) await this.#keep(isPage(answer) ? pageKey(url) : url, answer, true);
    return answer;
  }

  /** Puts what was held back, and lets go of what this run did not meet. */
  async commit(also: readonly string[]): Promise<void> {
    for (const [key, response] of this.#held) await this.#put(key, response);
    for (const request of await this.#cache.keys()) if (!this.#touched.has(request.url) && !also.includes(request.url)) await this.#cache.delete(request);
  }

  #same(url: string, kept: Response): boolean {
    const tag = tagOf(kept.headers);
    return tag !== "" && tag === this.#tags.get(url);
  }

  #count(key: string, kept: Response): void {
    if (this.#touched.has(key)) return;
    this.#touched.add(key);
    this.bytes += Number(kept.headers.get("content-length"));
  }

  async #keep(key: string, answer: Response, held = /\/rendering\.json$/.test(key)): Promise<Response> {
    const bytes = await answer.arrayBuffer();
    const headers = new Headers(answer.headers);
    for (const name of NOT_KEPT) headers.delete(name);
    headers.set("content-length", String(bytes.byteLength));
    const [status, body] = answer.status === 204 ? [204, null] : [200, bytes];
    const kept = new Response(body, { status, headers });
    this.#count(key, kept);
    if (held) this.#held.set(key, kept);
    else await this.#put(key, kept);
    return new Response(body, { status: answer.status, headers });
  }

  async #put(key: string, response: Response): Promise<void> {
    try {
      await this.#cache.put(key, response);
    } catch (reason) {
      const error = new StorageError(`the browser could not keep ${key} (${reason instanceof Error ? reason.name : String(reason)}): its room for this site is used up; keep a smaller area, or remove another one`);
      this.#failed(error);
      throw error;
    }
  }
}

const isPage = (answer: Response): boolean => (answer.headers.get("content-type") ?? "").startsWith("text/html");

import { FetchError, UsageError } from "../core/errors";
import type { Tile } from "../geo/frame";
import { readManifest, type LayerInfo, type Rendering, type View } from "../geo/manifest";
import { fetchBytes, fetchJson, type FetchFunction, type FetchOptions } from "./fetch";
import { Archive, type ReadRange } from "./pmtiles";
import type { TileData } from "./tileData";
import { normalizeBaseUrl, tileUrls } from "./url";

/** The origin of a rendering: its manifest, the files next to it, and its encoded tiles. Several layers may share one. */
export interface Source {
  /** Returns the checked manifest. @param reload past the browser's cache  @throws ManifestError, FetchError */
  manifest(signal?: AbortSignal, reload?: boolean): Promise<Rendering>;
  /** Returns a parsed file from the manifest's folder; null when it does not exist. @throws FetchError */
  json(path: string): Promise<unknown>;
  /** Returns the tile, encoded or decoded, owned by the caller; null when it is empty. @throws FetchError, or the signal's reason */
  tile(view: View, layer: LayerInfo, tile: Tile, signal?: AbortSignal): Promise<ArrayBuffer | TileData | null>;
}

/** Reads a rendering over HTTP: tiles spread over several hosts, or archives if the manifest lists them. */
export class HttpSource implements Source {
  /** Absolute base URLs. */
  readonly bases: readonly string[];
  readonly #fetch: FetchFunction | undefined;
  readonly #archives = new Map<string, Archive>();

  /** @param fetch replaces the browser's fetch  @throws UsageError without a URL */
  constructor(urls: string | readonly string[], fetch?: FetchFunction) {
    const list = (typeof urls === "string" ? [urls] : Array.isArray(urls) ? urls : []) as string[];
    if (list.length === 0 || !list.every((url) => typeof url === "string" && url !== ""))
      throw new UsageError('an imageLayer needs at least one base URL, e.g. "https://host/tiles/teatime"');
    this.bases = list.map((url) => normalizeBaseUrl(url, document.baseURI));
    this.#fetch = fetch;
  }

  async json(path: string): Promise<unknown> {
    const urls = this.#urls(path);
    try {
      return await fetchJson(urls, this.#withFetch({ attempts: Math.max(4, urls.length) }));
    } catch (reason) {
      if (reason instanceof FetchError && reason.status === 404) return null;
      throw reason;
    }
  }

  async manifest(signal?: AbortSignal, reload = false): Promise<Rendering> {
    const urls = this.#urls("rendering.json");
    try {
      return readManifest(await fetchJson(urls, this.#withFetch({ signal, reload, attempts: Math.max(3, urls.length) })), urls[0] ?? "");
    } catch (reason) {
      if (reason instanceof FetchError && reason.status === 404) reason.message += "; pass the URL of its folder";
      throw reason;
    }
  }

  tile(view: View, layer: LayerInfo, tile: Tile, signal?: AbortSignal): Promise<ArrayBuffer | null> {
    const archive = view.archives?.[layer.name];
    if (archive !== undefined) return this.#openArchive(archive, view.part_bytes).tile(tile, signal);
    return fetchBytes(tileUrls(this.bases, view.id, layer.name, tile, view.versionOf(tile, layer)), this.#withFetch({ signal }));
  }

  #urls(path: string): string[] {
    return this.bases.map((base) => `${base}/${path}`);
  }

  #withFetch(options: FetchOptions): FetchOptions {
    return { ...options, fetch: this.#fetch };
  }

  #openArchive(path: string, part_bytes?: number): Archive {
    const known = this.#archives.get(path);
    if (known) return known;
    const open =
      (file: string): ReadRange =>
      async (offset, length, signal) => {
        const urls = this.#urls(file);
        const bytes = await fetchBytes(urls, this.#withFetch({ range: [offset, length], signal }));
        if (!bytes) throw new FetchError(`${urls[0] ?? file}: no content`, 204);
        return bytes;
      };
    const archive = new Archive(path, open, part_bytes);
    this.#archives.set(path, archive);
    return archive;
  }
}

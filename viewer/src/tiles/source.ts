import { FetchError } from "../core/errors";
import type { Tile } from "../geo/frame";
import { readManifest, type LayerInfo, type Rendering, type View } from "../geo/manifest";
import { fetchBytes, fetchJson } from "./fetch";
import { Archive } from "./pmtiles";
import { tileUrls } from "./url";

/** Where the encoded tiles of a rendering come from: tile URLs over several hosts, or archives when the manifest names them. */
export class Source {
  readonly #bases: readonly string[];
  readonly #archives = new Map<string, Archive>();

  constructor(bases: readonly string[]) {
    this.#bases = bases;
  }

  /** A file beside the manifest; null when there is none. @throws FetchError */
  async json(path: string): Promise<unknown> {
    const urls = this.#bases.map((base) => `${base}/${path}`);
    try {
      return await fetchJson(urls, { attempts: Math.max(4, urls.length) });
    } catch (reason) {
      if (reason instanceof FetchError && reason.status === 404) return null;
      throw reason;
    }
  }

  /** @throws ManifestError, FetchError */
  async manifest(signal?: AbortSignal): Promise<Rendering> {
    const urls = this.#bases.map((base) => `${base}/rendering.json`);
    return readManifest(await fetchJson(urls, { signal, attempts: Math.max(3, urls.length) }), urls[0] ?? "");
  }

  /** The encoded tile; null when it is empty. */
  tile(view: View, layer: LayerInfo, tile: Tile, signal?: AbortSignal): Promise<ArrayBuffer | null> {
    const archive = view.archives?.[layer.name];
    if (archive !== undefined) return this.#archive(archive).tile(tile, signal);
    return fetchBytes(tileUrls(this.#bases, view.id, layer.name, tile, view.versionOf(tile, layer)), { signal });
  }

  #archive(path: string): Archive {
    const known = this.#archives.get(path);
    if (known) return known;
    const urls = this.#bases.map((base) => `${base}/${path}`);
    const archive = new Archive(path, async (offset, length, signal) => {
      const bytes = await fetchBytes(urls, { range: [offset, length], signal });
      if (!bytes) throw new FetchError(`${urls[0] ?? path}: no content`, 204);
      return bytes;
    });
    this.#archives.set(path, archive);
    return archive;
  }
}

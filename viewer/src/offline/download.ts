import { asError } from "../core/errors";
import {
  FetchError,
  HttpSource,
  UsageError,
  type AttributeInfo,
  type Map3D,
  type Rendering,
  type Tile,
  type View,
  type LayerInfo,
} from "../map3d";
import { readArea, storage, writeArea, type StoredArea } from "./areas";
import { CACHE, RECORD } from "./cacheKeys";
import { OfflineCache, StorageError } from "./offlineCache";
import { resolveOptions, tilesOf, type AreaOptions, type FilledArea, type PlannedTile } from "./areaPlan";

/** Estimated size of an area. */
export interface AreaEstimate {
  readonly tiles: number;
  /** Size of the tiles, extrapolated from a sample. */
  readonly bytes: number;
  /** Storage available to this site; null when the browser does not report it. */
  readonly free_bytes: number | null;
}

/** Progress of a download. */
export interface AreaProgress {
  /** Number of saved tiles, out of `total`. */
  readonly done: number;
  readonly total: number;
  readonly bytes: number;
}

/** Options of `downloadArea`. */
export interface DownloadOptions extends AreaOptions {
  /** Name of the area. An existing area of that name is resumed or updated. Default "area". */
  name?: string;
  /** Files of the page to save with the area. Default: the page and the files that it has loaded from its own host. */
  files?: readonly string[];
  /** Number of parallel requests. Default 6. */
  concurrency?: number;
  /** Aborts the download; the promise rejects with the signal's reason. Saved tiles stay, so that the download can be resumed. Default: none. */
  signal?: AbortSignal;
  /** Called after each tile. Default: none. */
  onProgress?: (progress: AreaProgress) => void;
}

/** A rendering to save, with a source that caches its responses. */
interface OfflineRendering {
  readonly source: HttpSource;
  readonly rendering: Rendering;
}

/** Number of sampled tiles per layer. */
const SAMPLES = 6;

/** Estimates the number of tiles and bytes of an area. Fetches a few tiles to sample their sizes. @throws UsageError, FetchError */
export async function estimateArea(shown: Map3D, options: AreaOptions = {}): Promise<AreaEstimate> {
  const area = await resolveOptions(shown, options);
  return estimate(await openRenderings(shown), area);
}

/**
 * Saves an area of a map, and the page, in the browser. With the service worker of `registerWorker`, both open offline. The area is complete only when all its
 * files are saved. @throws UsageError, FetchError when a request fails, StorageError when storage is full, or the signal's reason
 */
export async function downloadArea(shown: Map3D, options: DownloadOptions = {}): Promise<StoredArea> {
  const { name = "area", concurrency = 6, onProgress, signal } = options;
  const area = await resolveOptions(shown, options);
  const ending = new AbortController();
  const stop = (): void => ending.abort(signal?.reason);
  signal?.throwIfAborted();
  signal?.addEventListener("abort", stop);
  try {
    const store = await storage().open(CACHE + name);
    const cache = new OfflineCache(store, (error) => ending.abort(error));
    const renderings = await openRenderings(shown, cache);
    const before = await readArea(name);
    const { tiles, bytes, free_bytes } = await estimate(renderings, area);
    void navigator.storage.persist();
    if (free_bytes !== null && bytes - (before?.bytes ?? 0) > free_bytes)
      throw new StorageError(
        `not enough storage: the area needs about ${megabytes(bytes)}, ${megabytes(free_bytes)} are available; save a smaller area or delete another one`,
      );
    const record: StoredArea = {
      ...area,
      name,
      title: renderings.map(({ rendering: { json } }) => json.title || json.name).join(", "),
      tiles,
      bytes,
      complete: false,
      stored: new Date().toISOString(),
    };
    if (before?.complete !== true) await writeArea(store, record);
    const shards = new ShardCollector(shown, area, renderings);
    let done = 0;
    await runParallel(allTiles(renderings, area), concurrency, async (planned) => {
      const response = await planned.source.tile(planned.view, planned.layer, planned.tile, ending.signal);
      if (response) await shards.add(planned, response);
      onProgress?.({ done: ++done, total: tiles, bytes: cache.bytes });
    });
    if (area.objects) await saveObjects(renderings, shards, concurrency);
    await runParallel((options.files ?? pageFiles()).values(), concurrency, (file) => saveFile(cache, file, ending.signal));
    ending.signal.throwIfAborted();
    await cache.commit([RECORD]);
    const completed = { ...record, complete: true, bytes: cache.bytes, stored: new Date().toISOString() };
    await writeArea(store, completed);
    return completed;
  } catch (reason) {
    throw ending.signal.aborted ? ending.signal.reason : asError(reason);
  } finally {
    signal?.removeEventListener("abort", stop);
  }
}

/** Opens the map's renderings and reads their current manifests. */
async function openRenderings(shown: Map3D, cache?: OfflineCache): Promise<OfflineRendering[]> {
  return Promise.all(
    shown.layers
      .filter(({ rendering }) => rendering)
      .map(async ({ source: original }) => {
        if (!(original instanceof HttpSource))
          throw new UsageError("only renderings from URLs can be saved; this layer has another source");
        const source = new HttpSource(original.bases, cache?.fetch);
        return { source, rendering: await source.manifest() };
      }),
  );
}

function* allTiles(renderings: readonly OfflineRendering[], area: FilledArea): Generator<PlannedTile & OfflineRendering> {
  for (const each of renderings) for (const planned of tilesOf(each.rendering, area)) yield { ...each, ...planned };
}

async function estimate(renderings: readonly OfflineRendering[], area: FilledArea): Promise<AreaEstimate> {
  const groups = new Map<string, { count: number; step: number; sample: (PlannedTile & OfflineRendering)[] }>();
  for (const planned of allTiles(renderings, area)) {
    const name = `${planned.rendering.json.name}/${planned.layer.name}`;
    const group = groups.get(name) ?? { count: 0, step: 1, sample: [] };
    groups.set(name, group);
    if (group.count++ % group.step === 0) group.sample.push(planned);
    if (group.sample.length < 2 * SAMPLES) continue;
    group.sample = group.sample.filter((_, k) => k % 2 === 0);
    group.step *= 2;
  }
  let [tiles, bytes] = [0, 0];
  for (const { count, sample } of groups.values()) {
    const sizes = await Promise.all(
      sample.map(async ({ source, view, layer, tile }) => (await source.tile(view, layer, tile))?.byteLength ?? 0),
    );
    tiles += count;
    bytes += (count * sizes.reduce((sum, size) => sum + size, 0)) / sizes.length;
  }
  if (tiles === 0) throw new UsageError("the map has no tiles in these bounds and levels");
  const { quota, usage = 0 } = await navigator.storage.estimate();
  return { tiles, bytes: Math.round(bytes), free_bytes: quota === undefined ? null : Math.max(quota - usage, 0) };
}

/** Runs a task for each item, several in parallel; the first failure ends all. */
async function runParallel<T>(items: Iterator<T>, concurrency: number, run: (item: T) => Promise<void>): Promise<void> {
  let failed = false;
  await Promise.all(
    Array.from({ length: concurrency }, async () => {
      for (let next = items.next(); !failed && next.done !== true; next = items.next()) {
        await run(next.value).catch((reason: unknown) => {
          failed = true;
          throw reason;
        });
      }
    }),
  );
}

/** Collects the attribute shards of the objects in the tiles of the deepest level. */
class ShardCollector {
  readonly #shards = new Map<Rendering, Set<number>>();
  readonly #shown: Map3D;
  readonly #last: number;

  constructor(shown: Map3D, { levels: [, last] }: FilledArea, renderings: readonly OfflineRendering[]) {
    [this.#shown, this.#last] = [shown, last];
    for (const { rendering } of renderings) this.#shards.set(rendering, new Set());
  }

  async add(
    { rendering, layer, tile }: { rendering: Rendering; layer: LayerInfo; tile: Tile; view: View },
    bytes: ArrayBuffer,
  ): Promise<void> {
    const { objects, zmax } = rendering.json;
    if (!objects || (layer.kind !== "id" && layer.kind !== "data") || tile.z !== Math.min(this.#last, zmax)) return;
    const data = await this.#shown.layerContext?.tileResources.decoder.decode("id", layer.media_type, bytes);
    if (data?.kind !== "id") return;
    const shards = this.#shards.get(rendering);
    let previous = 0;
    for (const id of data.values) {
      if (id !== previous && id !== 0) shards?.add(Math.floor(id / objects.shard_size));
      previous = id;
    }
  }

  shardsOf(rendering: Rendering): ReadonlySet<number> {
    return this.#shards.get(rendering) ?? new Set();
  }
}

/** Saves the search index, and the attributes of the objects in the area: by object, and in the columns that themes use. */
async function saveObjects(renderings: readonly OfflineRendering[], collector: ShardCollector, concurrency: number): Promise<void> {
  for (const { source, rendering } of renderings) {
    const { objects } = rendering.json;
    if (!objects) continue;
    const list =
      objects.attributes === undefined
        ? null
        : ((await source.json(objects.attributes)) as { attributes?: readonly AttributeInfo[] } | null);
    const columns = (list?.attributes ?? []).flatMap(({ column }) => objects.columns?.replace("{column}", column) ?? []);
    const numbers = [...collector.shardsOf(rendering)];
    const shards = numbers.map((shard) => objects.shards.replace("{shard}", String(shard)));
    const save = async (path: string): Promise<void> => {
      const file = (await source.json(path)) as { pages?: readonly string[]; shards?: readonly number[]; shard_size?: number } | null;
      const wanted = new Set(numbers.map((shard) => Math.floor((shard * objects.shard_size) / (file?.shard_size ?? 1))));
      for (const name of file?.pages ?? file?.shards?.filter((shard) => wanted.has(shard)) ?? [])
        await save(path.replace(/\.json$/, `/${String(name)}.json`));
    };
    await runParallel([...(objects.search === undefined ? [] : [objects.search]), ...columns, ...shards].values(), concurrency, save);
  }
}

/** Returns the URLs of the page and of the files that it has loaded from its own host. */
function pageFiles(): string[] {
  const loaded = performance
    .getEntriesByType("resource")
    .filter((entry) => !["fetch", "xmlhttprequest", "beacon"].includes((entry as PerformanceResourceTiming).initiatorType))
    .map(({ name }) => name);
  return [...new Set([location.href, ...loaded].map((url) => url.replace(/#.*$/, "")))].filter((url) =>
    url.startsWith(`${location.origin}/`),
  );
}

async function saveFile(cache: OfflineCache, file: string, signal: AbortSignal): Promise<void> {
  const url = new URL(file, document.baseURI).href;
  const { ok, status } = await cache.savePage(url, { signal });
  if (!ok) throw new FetchError(`${url}: HTTP ${String(status)}; list the files of the page in the option "files"`, status);
}

const megabytes = (bytes: number): string => `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB`;

import { asError } from "../core/errors";
import { FetchError, HttpSource, UsageError, type AttributeInfo, type map, type Rendering, type Tile, type View, type LayerInfo } from "../map3d";
import { readArea, storage, writeArea, type StoredArea } from "./areas";
import { CACHE, RECORD } from "./keys";
import { Keeper, StorageError } from "./keeper";
import { filled, tilesOf, type AreaOptions, type FilledArea, type Wanted } from "./plan";

/** What an area needs. */
export interface AreaEstimate {
  readonly tiles: number;
  /** Of the tiles, from the sizes of some of them. */
  readonly bytes: number;
  /** What the browser would keep for this site yet; null when it does not say. */
  readonly free_bytes: number | null;
}

/** How far a download is. */
export interface AreaProgress {
  /** Tiles that are kept, of `total`. */
  readonly done: number;
  readonly total: number;
  readonly bytes: number;
}

/** Of `downloadArea`. */
export interface DownloadOptions extends AreaOptions {
  /** Of the area; one of that name is gone on with, or brought up to date. Default "area". */
  name?: string;
  /** The page's own files, kept with it. Default: the page, and what it has loaded from its own host. */
  files?: readonly string[];
  /** Requests at once. Default 6. */
  concurrency?: number;
  /** Stops it: the promise is rejected with the signal's reason. What has been kept stays, to go on with. */
  signal?: AbortSignal;
  /** Called after each tile. */
  onProgress?: (progress: AreaProgress) => void;
}

/** A rendering to be kept, read through what keeps it. */
interface Kept {
  readonly source: HttpSource;
  readonly rendering: Rendering;
}

/** Tiles of each layer of which sizes are taken. */
const SAMPLES = 6;

/** How many tiles and bytes an area needs. Some tiles are fetched, for their sizes. @throws UsageError, FetchError */
export async function estimateArea(shown: map, options: AreaOptions = {}): Promise<AreaEstimate> {
  const area = await filled(shown, options);
  return estimate(await open(shown), area);
}

/**
 * Keeps an area of a map in the browser, with the page around it: `registerWorker` makes both open without a network. The area counts as kept when all of it is.
 * @throws UsageError, FetchError when something cannot be had, StorageError when there is no room, or the signal's reason
 */
export async function downloadArea(shown: map, options: DownloadOptions = {}): Promise<StoredArea> {
  const { name = "area", concurrency = 6, onProgress, signal } = options;
  const area = await filled(shown, options);
  const ending = new AbortController();
  const stop = (): void => { ending.abort(signal?.reason); };
  signal?.throwIfAborted();
  signal?.addEventListener("abort", stop);
  try {
    const cache = await storage().open(CACHE + name);
    const keeper = new Keeper(cache, (error) => { ending.abort(error); });
    const kept = await open(shown, keeper);
    const before = await readArea(name);
    const { tiles, bytes, free_bytes } = await estimate(kept, area);
    void navigator.storage.persist();
    if (free_bytes !== null && bytes - (before?.bytes ?? 0) > free_bytes) throw new StorageError(`the area needs about ${megabytes(bytes)}, the browser keeps ${megabytes(free_bytes)} more for this site; keep a smaller area, or remove another one`);
    const record: StoredArea = { ...area, name, title: kept.map(({ rendering: { json } }) => json.title || json.name).join(", "), tiles, bytes, complete: false, stored: new Date().toISOString() };
    if (before?.complete !== true) await writeArea(cache, record);
    const ids = new Ids(shown, area, kept);
    let done = 0;
    await pool(allTiles(kept, area), concurrency, async (wanted) => {
      const got = await wanted.source.tile(wanted.view, wanted.layer, wanted.tile, ending.signal);
      if (got) await ids.read(wanted, got);
      onProgress?.({ done: ++done, total: tiles, bytes: keeper.bytes });
    });
    if (area.objects) await keepObjects(kept, ids, concurrency);
    await pool((options.files ?? pageFiles()).values(), concurrency, (file) => keepFile(keeper, file, ending.signal));
    ending.signal.throwIfAborted();
    await keeper.commit([RECORD]);
    const whole = { ...record, complete: true, bytes: keeper.bytes, stored: new Date().toISOString() };
    await writeArea(cache, whole);
    return whole;
  } catch (reason) {
    throw ending.signal.aborted ? ending.signal.reason : asError(reason);
  } finally {
    signal?.removeEventListener("abort", stop);
  }
}

/** The map's renderings, their manifests as they are now. */
async function open(shown: map, keeper?: Keeper): Promise<Kept[]> {
  return Promise.all(shown.layers.filter(({ rendering }) => rendering).map(async ({ source: given }) => {
    if (!(given instanceof HttpSource)) throw new UsageError("only renderings that come from URLs can be kept; this one comes from files");
    const source = new HttpSource(given.bases, keeper?.ask);
    return { source, rendering: await source.manifest() };
  }));
}

function* allTiles(kept: readonly Kept[], area: FilledArea): Generator<Wanted & Kept> {
  for (const each of kept) for (const wanted of tilesOf(each.rendering, area)) yield { ...each, ...wanted };
}

async function estimate(kept: readonly Kept[], area: FilledArea): Promise<AreaEstimate> {
  const groups = new Map<string, { count: number; step: number; some: (Wanted & Kept)[] }>();
  for (const wanted of allTiles(kept, area)) {
    const name = `${wanted.rendering.json.name}/${wanted.layer.name}`;
    const group = groups.get(name) ?? { count: 0, step: 1, some: [] };
    groups.set(name, group);
    if (group.count++ % group.step === 0) group.some.push(wanted);
    if (group.some.length < 2 * SAMPLES) continue;
    group.some = group.some.filter((_, k) => k % 2 === 0);
    group.step *= 2;
  }
  let [tiles, bytes] = [0, 0];
  for (const { count, some } of groups.values()) {
    const sizes = await Promise.all(some.map(async ({ source, view, layer, tile }) => (await source.tile(view, layer, tile))?.byteLength ?? 0));
    tiles += count;
    bytes += (count * sizes.reduce((sum, size) => sum + size, 0)) / sizes.length;
  }
  if (tiles === 0) throw new UsageError("nothing of the map lies in these bounds and levels");
  const { quota, usage = 0 } = await navigator.storage.estimate();
  return { tiles, bytes: Math.round(bytes), free_bytes: quota === undefined ? null : Math.max(quota - usage, 0) };
}

/** Runs a job for each, some at once; the first failure ends all. */
async function pool<T>(items: Iterator<T>, concurrency: number, run: (item: T) => Promise<void>): Promise<void> {
  let failed = false;
  await Promise.all(Array.from({ length: concurrency }, async () => {
    for (let next = items.next(); !failed && next.done !== true; next = items.next()) {
      await run(next.value).catch((reason: unknown) => {
        failed = true;
        throw reason;
      });
    }
  }));
}

/** Objects that are seen in the tiles of the deepest level, by the shards that tell of them. */
class Ids {
  readonly #shards = new Map<Rendering, Set<number>>();
  readonly #shown: map;
  readonly #last: number;

  constructor(shown: map, { levels: [, last] }: FilledArea, kept: readonly Kept[]) {
    [this.#shown, this.#last] = [shown, last];
    for (const { rendering } of kept) this.#shards.set(rendering, new Set());
  }

  async read({ rendering, layer, tile }: { rendering: Rendering; layer: LayerInfo; tile: Tile; view: View }, bytes: ArrayBuffer): Promise<void> {
    const { objects, zmax } = rendering.json;
    if (!objects || layer.kind !== "id" || tile.z !== Math.min(this.#last, zmax)) return;
    const data = await this.#shown.layerContext?.tileResources.decoder.decode("id", layer.media_type, bytes);
    if (data?.kind !== "id") return;
    const shards = this.#shards.get(rendering);
    let before = 0;
    for (const id of data.values) {
      if (id !== before && id !== 0) shards?.add(Math.floor(id / objects.shard_size));
      before = id;
    }
  }

  shardsOf(rendering: Rendering): ReadonlySet<number> {
    return this.#shards.get(rendering) ?? new Set();
  }
}

/** What is asked for beside the tiles: names to search, values to colour by, attributes of what is in the area. */
async function keepObjects(kept: readonly Kept[], ids: Ids, concurrency: number): Promise<void> {
  for (const { source, rendering } of kept) {
    const { objects } = rendering.json;
    if (!objects) continue;
    const list = objects.attributes === undefined ? null : ((await source.json(objects.attributes)) as { attributes?: readonly AttributeInfo[] } | null);
    const columns = (list?.attributes ?? []).flatMap(({ column }) => objects.columns?.replace("{column}", column) ?? []);
    const shards = [...ids.shardsOf(rendering)].map((shard) => objects.shards.replace("{shard}", String(shard)));
    await pool([objects.search, ...columns, ...shards].values(), concurrency, async (path) => { await source.json(path); });
  }
}

/** The page and what it has loaded from its own host. */
function pageFiles(): string[] {
  const loaded = performance.getEntriesByType("resource").filter((entry) => !["fetch", "xmlhttprequest", "beacon"].includes((entry as PerformanceResourceTiming).initiatorType)).map(({ name }) => name);
  return [...new Set([location.href, ...loaded].map((url) => url.replace(/#.*$/, "")))].filter((url) => url.startsWith(`${location.origin}/`));
}

async function keepFile(keeper: Keeper, file: string, signal: AbortSignal): Promise<void> {
  const url = new URL(file, document.baseURI).href;
  const { ok, status } = await keeper.page(url, { signal });
  if (!ok) throw new FetchError(`${url}: HTTP ${String(status)}; name the page's own files by the option "files"`, status);
}

const megabytes = (bytes: number): string => `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB`;

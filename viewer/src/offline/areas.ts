import { CACHE, RECORD } from "./cacheKeys";
import { StorageError } from "./offlineCache";
import type { FilledArea } from "./areaPlan";

/** A saved or incomplete area. LayerPass it to `downloadArea` to resume or update it. */
export interface StoredArea extends FilledArea {
  readonly name: string;
  /** Titles of its renderings. */
  readonly title: string;
  /** False for a download that was interrupted. */
  readonly complete: boolean;
  /** Time of completion, or of the start while incomplete; ISO 8601. */
  readonly stored: string;
  readonly tiles: number;
  readonly bytes: number;
}

/** Returns the Cache Storage of this site. @throws StorageError where it is not available */
export function storage(): CacheStorage {
  if (!("caches" in globalThis))
    throw new StorageError("offline storage is not available; the page must be served over https or from localhost");
  return caches;
}

/** Lists the areas saved by this site, the latest first. */
export async function listAreas(): Promise<StoredArea[]> {
  const names = (await storage().keys()).filter((name) => name.startsWith(CACHE));
  const areas = await Promise.all(names.map((name) => readArea(name.slice(CACHE.length))));
  return areas.flatMap((area) => area ?? []).sort((a, b) => (a.stored < b.stored ? 1 : -1));
}

/** Returns an area by its name, or null. */
export async function readArea(name: string): Promise<StoredArea | null> {
  const record = await storage().match(RECORD, { cacheName: CACHE + name });
  return record ? ((await record.json()) as StoredArea) : null;
}

export async function writeArea(cache: Cache, area: StoredArea): Promise<void> {
  await cache.put(RECORD, new Response(JSON.stringify(area), { headers: { "content-type": "application/json" } }));
}

/** Deletes an area. @returns false when no area has that name */
export const removeArea = (name: string): Promise<boolean> => storage().delete(CACHE + name);

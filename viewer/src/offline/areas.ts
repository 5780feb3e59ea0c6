import { CACHE, RECORD } from "./keys";
import { StorageError } from "./keeper";
import type { FilledArea } from "./plan";

/** An area that is kept, or was begun. Its fields are options of `downloadArea`, which goes on with it or brings it up to date. */
export interface StoredArea extends FilledArea {
  readonly name: string;
  /** Of the renderings. */
  readonly title: string;
  /** Everything is there. */
  readonly complete: boolean;
  /** When it was finished, or begun; ISO 8601. */
  readonly stored: string;
  readonly tiles: number;
  readonly bytes: number;
}

/** The caches of this site. @throws StorageError where there are none */
export function storage(): CacheStorage {
  if (!("caches" in globalThis)) throw new StorageError("this browser keeps nothing here: pages need https, or localhost");
  return caches;
}

/** Areas of this site, the latest first. */
export async function listAreas(): Promise<StoredArea[]> {
  const names = (await storage().keys()).filter((name) => name.startsWith(CACHE));
  const areas = await Promise.all(names.map((name) => readArea(name.slice(CACHE.length))));
  return areas.flatMap((area) => area ?? []).sort((a, b) => (a.stored < b.stored ? 1 : -1));
}

/** null when there is none of that name. */
export async function readArea(name: string): Promise<StoredArea | null> {
  const record = await storage().match(RECORD, { cacheName: CACHE + name });
  return record ? ((await record.json()) as StoredArea) : null;
}

export async function writeArea(cache: Cache, area: StoredArea): Promise<void> {
  await cache.put(RECORD, new Response(JSON.stringify(area), { headers: { "content-type": "application/json" } }));
}

/** Frees the room of an area. @returns false when there is none of that name */
export const removeArea = (name: string): Promise<boolean> => storage().delete(CACHE + name);

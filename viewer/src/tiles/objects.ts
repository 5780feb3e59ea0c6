import { FetchError } from "../core/errors";
import type { Box3, Vec3 } from "../core/vec";
import type { ManifestJson } from "../geo/manifest";
import type { Source } from "./source";

/** Attribute values are text, never HTML. */
export type Attribute = string | number | boolean | null;

/** What the registry says of an object. */
export interface ObjectInfo {
  readonly name: string;
  readonly class: string;
  /** Id of the object that it is a part of. */
  readonly parent: number | null;
  /** The source document it came from. */
  readonly asset?: string;
  /** Local coordinates. */
  readonly box?: Box3;
  readonly attributes: Readonly<Record<string, Attribute>>;
}

/** id, label, local position. */
export type SearchEntry = readonly [number, string, Vec3];

/** A value that is there. */
export type AttributeValue = Exclude<Attribute, null>;

/** An attribute, as the index lists it. */
export interface AttributeInfo {
  readonly name: string;
  /** What every object has (class, asset), or its attributes. */
  readonly of: "object" | "attributes";
  readonly column: string;
  readonly type: "number" | "text" | "boolean" | "mixed";
  /** How many objects have a value of their own. */
  readonly objects: number;
  /** Different values, counted up to 1,000. */
  readonly variety: number;
  /** Of numbers. */
  readonly min?: number;
  readonly max?: number;
}

interface Column {
  readonly ids: readonly number[];
  readonly values: readonly AttributeValue[];
}

type Shard = Readonly<Record<string, ObjectInfo>>;
const MAX_SHARDS = 64;

/** Attributes of objects by id, fetched a shard at a time. */
export class Objects {
  readonly #source: Pick<Source, "json">;
  readonly #json: ManifestJson;
  readonly #shards = new Map<number, Promise<Shard>>();
  /** What has been fetched, or is on the way. */
  readonly #files = new Map<string, Promise<unknown>>();

  constructor(source: Pick<Source, "json">, json: ManifestJson) {
    this.#source = source;
    this.#json = json;
  }

  /** null when the rendering has no attributes of this object. */
  async find(id: number): Promise<ObjectInfo | null> {
    const { objects } = this.#json;
    if (!objects || id <= 0) return null;
    const shard = await this.#fetchShard(Math.floor(id / objects.shard_size), objects.shards);
    return Object.hasOwn(shard, String(id)) ? (shard[String(id)] ?? null) : null;
  }

  /** All entries of the search index, sorted by label; none when the rendering has no index. */
  search(): Promise<readonly SearchEntry[]> {
    const path = this.#json.objects?.search;
    if (path === undefined) return Promise.resolve([]);
    return this.#fetchOnce<{ entries: SearchEntry[] }>(path, "search").then((file) => file?.entries ?? []);
  }

  /** All attributes; none when the rendering does not list them. */
  attributes(): Promise<readonly AttributeInfo[]> {
    const path = this.#json.objects?.attributes;
    if (path === undefined) return Promise.resolve([]);
    return this.#fetchOnce<{ attributes: AttributeInfo[] }>(path, "attributes").then((file) => file?.attributes ?? []);
  }

  /** Values by id; none when there is no such column. */
  async column(name: string): Promise<ReadonlyMap<number, AttributeValue>> {
    const template = this.#json.objects?.columns;
    const file = template === undefined || !/^[0-9a-f]{16}$/.test(name) ? null : await this.#fetch<Column>(template.replace("{column}", name), "column");
    const values = file?.values ?? [];
    return new Map((file?.ids ?? []).slice(0, values.length).map((id, k) => [id, values[k] as AttributeValue]));
  }

  #fetchShard(number: number, template: string): Promise<Shard> {
    const known = this.#shards.get(number);
    if (known) return known;
    const shard = this.#fetch<{ objects: Shard }>(template.replace("{shard}", String(number)), "objects").then((file) => file?.objects ?? {});
    this.#shards.set(number, shard);
    shard.catch(() => this.#shards.delete(number));
    const oldest = this.#shards.keys().next();
    if (this.#shards.size > MAX_SHARDS && !oldest.done) this.#shards.delete(oldest.value);
    return shard;
  }

  /** A file that is kept; one that could not be had is asked for again. */
  #fetchOnce<T>(path: string, what: string): Promise<T | null> {
    const known = this.#files.get(path) as Promise<T | null> | undefined;
    if (known) return known;
    const file = this.#fetch<T>(path, what);
    this.#files.set(path, file);
    file.catch(() => this.#files.delete(path));
    return file;
  }

  /** null when there is no such file. */
  async #fetch<T>(path: string, what: string): Promise<T | null> {
    const file = (await this.#source.json(path)) as { map3d?: string; version?: number } | null;
    if (file && (file.map3d !== what || file.version !== 1)) throw new FetchError(`${path}: expected map3d "${what}" of version 1, got ${String(file.map3d)} ${String(file.version)}`, 200);
    return file as T | null;
  }
}

import { FetchError } from "../core/errors";
import type { Box3, Vec3 } from "../core/vec";
import type { ManifestJson } from "../geo/manifest";
import type { Source } from "./source";

/** Attribute values are text, never HTML. */
export type Attribute = string | number | boolean | null;

/** An object's entry in the registry. */
export interface ObjectInfo {
  readonly name: string;
  readonly class: string;
  /** Id of the object that contains it. */
  readonly parent: number | null;
  /** The asset that it comes from. */
  readonly asset?: string;
  /** Local coordinates. */
  readonly box?: Box3;
  readonly attributes: Readonly<Record<string, Attribute>>;
}

/** Id, label and local position. */
export type SearchEntry = readonly [number, string, Vec3];

/** The value of an attribute that is present. */
export type AttributeValue = Exclude<Attribute, null>;

/** An attribute as listed in the index. */
export interface AttributeInfo {
  readonly name: string;
  /** Whether every object has it (class, asset), or it comes from the attributes. */
  readonly of: "object" | "attributes";
  readonly column: string;
  readonly type: "number" | "text" | "boolean" | "mixed";
  /** Number of objects with a value of their own. */
  readonly objects: number;
  /** Number of distinct values, counted up to 1,000. */
  readonly variety: number;
  /** Only for numbers. */
  readonly min?: number;
  readonly max?: number;
}

interface Column {
  readonly ids: readonly number[];
  readonly values: readonly AttributeValue[];
}

type Shard = Readonly<Record<string, ObjectInfo>>;
const MAX_SHARDS = 64;

/** Reads objects' attributes by id; fetches them by shards. */
export class Objects {
  readonly #source: Pick<Source, "json">;
  readonly #json: ManifestJson;
  readonly #shards = new Map<number, Promise<Shard>>();
  /** Files that have been requested. */
  readonly #files = new Map<string, Promise<unknown>>();

  constructor(source: Pick<Source, "json">, json: ManifestJson) {
    this.#source = source;
    this.#json = json;
  }

  /** Returns an object's entry; null when the rendering has none. */
  async find(id: number): Promise<ObjectInfo | null> {
    const { objects } = this.#json;
    if (!objects || id <= 0) return null;
    const shard = await this.#fetchShard(Math.floor(id / objects.shard_size), objects.shards);
    return Object.hasOwn(shard, String(id)) ? (shard[String(id)] ?? null) : null;
  }

  /** Returns all entries of the search index, sorted by label; none when there is no index. */
  search(): Promise<readonly SearchEntry[]> {
    const path = this.#json.objects?.search;
    if (path === undefined) return Promise.resolve([]);
    return this.#fetchOnce<{ entries: SearchEntry[] }>(path, "search").then((file) => file?.entries ?? []);
  }

  /** Returns all attributes; none when the rendering does not list them. */
  attributes(): Promise<readonly AttributeInfo[]> {
    const path = this.#json.objects?.attributes;
    if (path === undefined) return Promise.resolve([]);
    return this.#fetchOnce<{ attributes: AttributeInfo[] }>(path, "attributes").then((file) => file?.attributes ?? []);
  }

  /** Returns the values of a column by object id; none when there is no such column. */
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

  /** Fetches a file and keeps it; after a failure the next call fetches it again. */
  #fetchOnce<T>(path: string, type: string): Promise<T | null> {
    const known = this.#files.get(path) as Promise<T | null> | undefined;
    if (known) return known;
    const file = this.#fetch<T>(path, type);
    this.#files.set(path, file);
    file.catch(() => this.#files.delete(path));
    return file;
  }

  /** Fetches a file; null when it does not exist. */
  async #fetch<T>(path: string, type: string): Promise<T | null> {
    const file = (await this.#source.json(path)) as { map3d?: string; version?: number } | null;
    if (file && (file.map3d !== type || file.version !== 1)) throw new FetchError(`${path}: expected map3d "${type}" version 1, got "${String(file.map3d)}" version ${String(file.version)}`, 200);
    return file as T | null;
  }
}

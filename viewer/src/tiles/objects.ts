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
  /** Ids of the objects that it contains, such as a building's parts. */
  readonly children?: readonly number[];
  /** The asset that it comes from. */
  readonly asset?: string;
  /** Local coordinates. */
  readonly box?: Box3;
  readonly attributes: Readonly<Record<string, Attribute>>;
}

/** Id, label, local position, and other words by which it is found. */
export type SearchEntry = readonly [id: number, label: string, position: Vec3, words?: string];

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

/** Statistics of a column that is divided into shards. */
export interface ColumnSummary {
  /** Ids per shard. */
  readonly shard_size: number;
  /** Numbers of the shards. */
  readonly shards: readonly number[];
  /** Number of objects with a value, inherited values included. */
  readonly objects: number;
  /** The most frequent values and their numbers of objects. */
  readonly values: readonly (readonly [AttributeValue, number])[];
  /** Evenly spaced values of the sorted numbers; only if all values are numbers. */
  readonly numbers?: readonly number[];
}

interface Column {
  readonly ids: readonly number[];
  readonly values: readonly AttributeValue[];
}

/** A page of the search index: entries, or pages and the least keys in them. */
interface SearchPage {
  readonly entries?: readonly SearchEntry[];
  readonly keys?: readonly string[];
  readonly pages?: readonly string[];
}

type Shard = Readonly<Record<string, ObjectInfo>>;
const MAX_SHARDS = 64;
/** Length of the keys in the search index. */
const MAX_KEY = 48;
/** Pages with entries that a search reads for the same beginning. */
const MAX_PAGES = 4;

/** Returns the words of a text: letters and digits, in lower case without accents, so that "strasse" matches "Straße" and "cafe" matches "Café". */
export function searchWords(text: string): string[] {
  return (
    text
      .toLowerCase()
      .replaceAll("ß", "ss")
      .normalize("NFD")
      .replace(/\p{M}/gu, "")
      .match(/[\p{L}\p{N}]+/gu) ?? []
  );
}

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

  /** Returns the objects that an object contains, and those that they contain. */
  async descendants(id: number): Promise<number[]> {
    const found = new Set([id]);
    for (const known of found) for (const child of (await this.find(known))?.children ?? []) found.add(child);
    found.delete(id);
    return [...found];
  }

  /**
   * Returns up to `limit` entries that contain all words of the text; those with the words in a row come first, then those that begin with the first word. In a large rendering, the text or one
   * of its words must be the beginning of a word; the others may be anywhere.
   */
  async search(text: string, limit = 8): Promise<SearchEntry[]> {
    const words = searchWords(text);
    const found = new Map<number, readonly [string, SearchEntry]>();
    const path = this.#json.objects?.search;
    for (const start of [words.join(" ").slice(0, MAX_KEY), ...[...words].sort((a, b) => b.length - a.length)]) {
      if (path === undefined || start === "" || found.size > 0) break;
      let count = 0;
      const read = async (name: string): Promise<void> => {
        const { entries, keys = [], pages = [] } = (await this.#fetchOnce<SearchPage>(name, "search", 2)) ?? {};
        for (const entry of entries ?? []) {
          const label = searchWords(`${entry[1]} ${entry[3] ?? ""}`).join(" ");
          if (words.every((word) => label.includes(word))) found.set(entry[0], [label, entry]);
        }
        if (entries) count++;
        let k = Math.max(keys.filter((key) => key < start).length - 1, 0);
        for (
          const first = k;
          k < pages.length && (k === first || keys[k]?.startsWith(start)) && count < MAX_PAGES && found.size < limit;
          k++
        )
          await read(pathBelow(path, pages[k] as string));
      };
      await read(path);
    }
    const rank = (label: string): number =>
      2 * Number(!` ${label}`.includes(` ${words.join(" ")}`)) + Number(!label.startsWith(words[0] ?? ""));
    return [...found.values()]
      .sort(([a], [b]) => rank(a) - rank(b) || (a < b ? -1 : 1))
      .slice(0, limit)
      .map(([, entry]) => entry);
  }

  /** Returns all attributes; none when the rendering does not list them. */
  attributes(): Promise<readonly AttributeInfo[]> {
    const path = this.#json.objects?.attributes;
    if (path === undefined) return Promise.resolve([]);
    return this.#fetchOnce<{ attributes: AttributeInfo[] }>(path, "attributes").then((file) => file?.attributes ?? []);
  }

  /** Returns the statistics of a column that is divided; null when it is one file, or there is none. */
  async summary(name: string): Promise<ColumnSummary | null> {
    const file = await this.#fetchColumn(name);
    return file && "shards" in file ? file : null;
  }

  /** Returns the values of a column by object id; none when there is no such column. @param ids reads only the shards of these objects */
  async column(name: string, ids?: Iterable<number>): Promise<ReadonlyMap<number, AttributeValue>> {
    const file = await this.#fetchColumn(name);
    const parts = file && "shards" in file ? await Promise.all(this.#fetchColumnShards(name, file, ids)) : [file];
    return new Map(
      parts.flatMap((part) =>
        (part?.ids ?? []).slice(0, part?.values.length).map((id, k) => [id, part?.values[k] as AttributeValue] as const),
      ),
    );
  }

  #columnPath(name: string): string {
    return this.#json.objects?.columns?.replace("{column}", name) ?? "";
  }

  #fetchColumn(name: string): Promise<Column | ColumnSummary | null> {
    return /^[0-9a-f]{16}$/.test(name) && this.#columnPath(name)
      ? this.#fetchOnce(this.#columnPath(name), "column", 2)
      : Promise.resolve(null);
  }

  #fetchColumnShards(name: string, { shards, shard_size }: ColumnSummary, ids?: Iterable<number>): Promise<Column | null>[] {
    const chosen = new Set(ids && Array.from(ids, (id) => Math.floor(id / shard_size)));
    return shards
      .filter((shard) => !ids || chosen.has(shard))
      .map((shard) => this.#fetchOnce<Column>(pathBelow(this.#columnPath(name), shard), "column"));
  }

  #fetchShard(number: number, template: string): Promise<Shard> {
    const known = this.#shards.get(number);
    if (known) return known;
    const shard = this.#fetch<{ objects: Shard }>(template.replace("{shard}", String(number)), "objects").then(
      (file) => file?.objects ?? {},
    );
    this.#shards.set(number, shard);
    shard.catch(() => this.#shards.delete(number));
    const oldest = this.#shards.keys().next();
    if (this.#shards.size > MAX_SHARDS && !oldest.done) this.#shards.delete(oldest.value);
    return shard;
  }

  /** Fetches a file and keeps it; after a failure the next call fetches it again. */
  #fetchOnce<T>(path: string, type: string, version = 1): Promise<T | null> {
    const known = this.#files.get(path) as Promise<T | null> | undefined;
    if (known) return known;
    const file = this.#fetch<T>(path, type, version);
    this.#files.set(path, file);
    file.catch(() => this.#files.delete(path));
    return file;
  }

  /** Fetches a file; null when it does not exist. @param version the newest one that can be read */
  async #fetch<T>(path: string, type: string, version = 1): Promise<T | null> {
    const file = (await this.#source.json(path)) as { map3d?: string; version?: number } | null;
    if (file && (file.map3d !== type || !(Number(file.version) <= version)))
      throw new FetchError(
        `${path}: expected map3d "${type}" version ${String(version)}, got "${String(file.map3d)}" version ${String(file.version)}`,
        200,
      );
    return file as T | null;
  }
}

/** Returns the path of a file in the folder that belongs to a file. */
const pathBelow = (path: string, name: string | number): string => path.replace(/\.json$/, `/${String(name)}.json`);

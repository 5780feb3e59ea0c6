import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { describe, expect, test } from "vitest";
import type { ManifestJson } from "../../src/geo/manifest";
import { Objects, searchWords, type SearchEntry } from "../../src/tiles/objects";

const json = {
  objects: {
    count: 2,
    shard_size: 1024,
    shards: "objects/{shard}.json",
    search: "objects/search.json",
    attributes: "objects/attributes.json",
    columns: "objects/columns/{column}.json",
  },
} as ManifestJson;

/** Returns the responses in order; records the requests. */
function sourceOf(...answers: unknown[]): { json: (path: string) => Promise<unknown>; asked: string[] } {
  const asked: string[] = [];
  return {
    asked,
    json: (path) => {
      asked.push(path);
      const answer = answers.shift();
      return answer instanceof Error ? Promise.reject(answer) : Promise.resolve(answer);
    },
  };
}

test("failed files are fetched again; fetched files are kept", async () => {
  const source = sourceOf(new Error("no answer"), { map3d: "search", version: 1, entries: [[7, "Hall", [0, 0, 0]]] });
  const objects = new Objects(source, json);
  await expect(objects.search("hall", 8)).rejects.toThrow("no answer");
  expect(await objects.search("hall", 8)).toHaveLength(1);
  expect(await objects.search("hall", 8)).toHaveLength(1);
  expect(source.asked).toEqual(["objects/search.json", "objects/search.json"]);
});

test("an entry is found by its other words, too; those of the label come first", async () => {
  const entries: SearchEntry[] = [
    [7, "Hall", [0, 0, 0], "b 4711 church eglise"],
    [8, "Church lane 1", [0, 0, 0]],
  ];
  const objects = new Objects(sourceOf({ map3d: "search", version: 1, entries }), json);
  expect((await objects.search("église")).map(([id]) => id)).toEqual([7]);
  expect((await objects.search("hall 4711")).map(([id]) => id)).toEqual([7]);
  expect((await objects.search("church")).map(([id]) => id)).toEqual([8, 7]);
});

test("a file of another type or version is refused by name; a missing file is empty", async () => {
  await expect(new Objects(sourceOf({ map3d: "search", version: 3, entries: [] }), json).search("hall", 8)).rejects.toThrow(
    'objects/search.json: expected map3d "search" version 2, got "search" version 3',
  );
  expect(await new Objects(sourceOf(null), json).attributes()).toEqual([]);
  expect(await new Objects(sourceOf({ map3d: "objects", version: 1, objects: {} }), json).find(5)).toBeNull();
});

test("descendants are found through all levels and shards; a cycle ends", async () => {
  const entry = (parent: number | null, children?: number[]): object => ({
    name: "",
    class: "building",
    parent,
    attributes: {},
    ...(children && { children }),
  });
  const shards = new Map<string, unknown>([
    [
      "objects/0.json",
      { map3d: "objects", version: 1, objects: { 1: entry(null, [2, 1030]), 2: entry(1), 3: entry(4, [4]), 4: entry(3, [3]) } },
    ],
    ["objects/1.json", { map3d: "objects", version: 1, objects: { 1030: entry(1, [1031]), 1031: entry(1030) } }],
  ]);
  const objects = new Objects(folderOf(shards), json);
  expect(await objects.descendants(1)).toEqual([2, 1030, 1031]);
  expect(await objects.descendants(2)).toEqual([]);
  expect(await objects.descendants(3)).toEqual([4]);
  expect(await objects.descendants(77)).toEqual([]);
});

const vectors = JSON.parse(readFileSync(resolve(import.meta.dirname, "../../../spec/vectors/search.json"), "utf8")) as {
  text: string;
  words: string[];
}[];

test.each(vectors)("the words of $text match the vectors", ({ text, words }) => {
  expect(searchWords(text)).toEqual(words);
});

/** Returns the files, and records the requests. */
function folderOf(files: Map<string, unknown>): { json: (path: string) => Promise<unknown>; asked: string[] } {
  const asked: string[] = [];
  return {
    asked,
    json: (path) => {
      asked.push(path);
      return Promise.resolve(files.get(path) ?? null);
    },
  };
}

/** Writes an index with leaves of 6 entries and nodes of 4 pages. */
function writeIndex(entries: readonly SearchEntry[]): Map<string, unknown> {
  const keyed = entries.flatMap((entry) => searchWords(entry[1]).map((_, k, words) => ({ key: words.slice(k).join(" "), entry })));
  keyed.sort((a, b) => (a.key < b.key ? -1 : a.key > b.key ? 1 : 0));
  const files = new Map<string, unknown>();
  const chunks = <T>(items: readonly T[], size: number): T[][] =>
    Array.from({ length: Math.ceil(items.length / size) }, (_, k) => items.slice(k * size, (k + 1) * size));
  let level: { key: string; page: object }[] = chunks(keyed, 6).map((rows) => ({
    key: rows[0]?.key ?? "",
    page: { map3d: "search", version: 2, entries: [...new Set(rows.map(({ entry }) => entry))] },
  }));
  while (level.length > 1) {
    level = chunks(level, 4).map((rows) => ({
      key: rows[0]?.key ?? "",
      page: {
        map3d: "search",
        version: 2,
        keys: rows.map(({ key }) => key),
        pages: rows.map(({ page }) => {
          const name = String(files.size).padStart(16, "0");
          files.set(`objects/search/${name}.json`, page);
          return name;
        }),
      },
    }));
  }
  return files.set("objects/search.json", level[0]?.page);
}

describe("a divided search index", () => {
  const streets = ["Hauptstraße", "Am Markt", "Marktplatz", "Rue de l'Église", "Hauptmarkt"];
  const entries = Array.from({ length: 1000 }, (_, k): SearchEntry => [
    k + 1,
    `DEBY_LOD2_${String(4000 + k)}, ${streets[k % 5] ?? ""} ${String(k % 97)}`,
    [k, 0, 0],
  ]);
  const files = writeIndex(entries);
  const labelsOf = (found: readonly SearchEntry[]): string[] => found.map(([, label]) => label);

  test.each(["haupt", "markt", "am markt 5", "4711", "LOD2_4123", "EGLISE", "rue de l'é"])(
    "finds labels with words that begin like %s, with few requests",
    async (text) => {
      const source = folderOf(files);
      const found = await new Objects(source, json).search(text);
      const start = searchWords(text).join(" ");
      const matching = entries.filter(([, label]) => ` ${searchWords(label).join(" ")}`.includes(` ${start}`));
      expect(found.length).toBe(Math.min(matching.length, 8));
      for (const entry of found) expect(matching).toContain(entry);
      expect(source.asked.length).toBeLessThanOrEqual(9);
      expect(files.size).toBeGreaterThan(500);
    },
  );

  test("lists labels with the words in a row before those with the words anywhere", async () => {
    const [first, second] = await new Objects(folderOf(files), json).search("hauptstrasse 45");
    expect(labelsOf([first, second] as SearchEntry[]).map((label) => label.split(", ")[1])).toEqual(["Hauptstraße 45", "Hauptstraße 45"]);
  });

  test("finds words in any order by the longest of them", async () => {
    const found = await new Objects(folderOf(files), json).search("4100 markt");
    expect(labelsOf(found)).toEqual(["DEBY_LOD2_4100, Hauptstraße 3"].filter((label) => label.includes("Markt")));
    expect(labelsOf(await new Objects(folderOf(files), json).search("markt 4101"))).toEqual(["DEBY_LOD2_4101, Am Markt 4"]);
  });

  test("reads no page twice, and nothing for a text without words", async () => {
    const source = folderOf(files);
    const objects = new Objects(source, json);
    for (const text of ["", " - ", "h", "ha", "hau", "haup", "h"]) await objects.search(text);
    expect(new Set(source.asked).size).toBe(source.asked.length);
    expect(await objects.search("nothing like this")).toEqual([]);
  });
});

test("an index of one file finds words anywhere in the label; labels that begin with the first word come first", async () => {
  const rows = ["Old town hall", "Café (Hall 3)", "Hall of arts", "Straße"].map((label, k) => [k + 1, label, [0, 0, 0]]);
  const objects = new Objects(folderOf(new Map([["objects/search.json", { map3d: "search", version: 1, entries: rows }]])), json);
  const find = async (text: string): Promise<string[]> => (await objects.search(text)).map(([, label]) => label);
  expect(await find("hall")).toEqual(["Hall of arts", "Café (Hall 3)", "Old town hall"]);
  expect(await find("own HA")).toEqual(["Old town hall"]);
  expect(await find("strasse")).toEqual(["Straße"]);
  expect(await objects.search("hall", 1)).toHaveLength(1);
});

test("a divided column is read by shard, or whole; a whole column has no summary", async () => {
  const [large, small] = ["0".repeat(16), "1".repeat(16)];
  const summary = {
    map3d: "column",
    version: 2,
    shard_size: 10,
    shards: [0, 2, 3],
    objects: 4,
    values: [
      ["a", 3],
      ["b", 1],
    ],
  };
  const part = (ids: number[], values: string[]): object => ({ map3d: "column", version: 1, ids, values });
  const source = folderOf(
    new Map<string, unknown>([
      [`objects/columns/${large}.json`, summary],
      [`objects/columns/${large}/0.json`, part([1, 9], ["a", "b"])],
      [`objects/columns/${large}/2.json`, part([20], ["a"])],
      [`objects/columns/${large}/3.json`, part([39], ["a"])],
      [`objects/columns/${small}.json`, part([7], ["c"])],
    ]),
  );
  const objects = new Objects(source, json);
  expect(await objects.summary(large)).toMatchObject({
    shard_size: 10,
    values: [
      ["a", 3],
      ["b", 1],
    ],
  });
  expect([...(await objects.column(large, [2, 11, 39]))]).toEqual([
    [1, "a"],
    [9, "b"],
    [39, "a"],
  ]);
  expect(source.asked).toEqual([`objects/columns/${large}.json`, `objects/columns/${large}/0.json`, `objects/columns/${large}/3.json`]);
  expect([...(await objects.column(large))].map(([id]) => id)).toEqual([1, 9, 20, 39]);
  expect(source.asked).toHaveLength(4);
  expect(await objects.summary(small)).toBeNull();
  expect([...(await objects.column(small, [1]))]).toEqual([[7, "c"]]);
});

import { expect, test } from "vitest";
import type { ManifestJson } from "../../src/geo/manifest";
import { Objects } from "../../src/tiles/objects";

const json = { objects: { count: 2, shard_size: 1024, shards: "objects/{shard}.json", search: "objects/search.json", attributes: "objects/attributes.json" } } as ManifestJson;

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
  await expect(objects.search()).rejects.toThrow("no answer");
  expect(await objects.search()).toHaveLength(1);
  expect(await objects.search()).toHaveLength(1);
  expect(source.asked).toEqual(["objects/search.json", "objects/search.json"]);
});

test("a file of another type or version is refused by name; a missing file is empty", async () => {
  await expect(new Objects(sourceOf({ map3d: "search", version: 2, entries: [] }), json).search()).rejects.toThrow('objects/search.json: expected map3d "search" version 1, got "search" version 2');
  expect(await new Objects(sourceOf(null), json).attributes()).toEqual([]);
  expect(await new Objects(sourceOf({ map3d: "objects", version: 1, objects: {} }), json).find(5)).toBeNull();
});

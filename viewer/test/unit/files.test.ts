import { beforeAll, describe, expect, test, vi } from "vitest";
import { filesSource } from "../../src/files/filesSource";
import { findManifestFolders, isInside } from "../../src/files/folder";
import { HttpSource, type Source } from "../../src/map3d";
import { tileName, type Tile } from "../../src/geo/frame";
import { published } from "../fixture/folder";
import { renderTown, type Fixture } from "../fixture/rendering";

const town = renderTown(32, 1.52);
const archived = published(town);

/** Files as a browser provides them for a chosen folder. */
function chosen({ json, files }: Fixture, base = "town/"): File[] {
  const all = new Map<string, Uint8Array | string>([["rendering.json", JSON.stringify(json)], ...files]);
  return [...all].map(([path, bytes]) =>
    Object.defineProperty(new File([bytes as BlobPart], path.split("/").at(-1) ?? ""), "webkitRelativePath", { value: base + path }),
  );
}

const refusal = (source: () => unknown): Promise<unknown> =>
  Promise.resolve()
    .then(source)
    .then(
      () => "nothing",
      (reason: unknown) => reason,
    );

describe.each([
  ["loose tiles", town],
  ["archives", archived],
])("a folder of %s", (_, fixture) => {
  let source: Source;
  beforeAll(() => {
    source = filesSource(chosen(fixture));
  });

  test("has the tiles that were written, byte for byte", async () => {
    const { views, json } = await source.manifest();
    let tiles = 0;
    for (const view of views.values()) {
      for (const layer of json.layers) {
        for (const tile of levels(json.zmax).filter((each) => view.occupancy.has(each))) {
          const bytes = (await source.tile(view, layer, tile)) as ArrayBuffer | null;
          expect(
            Buffer.from(bytes ?? new ArrayBuffer(0)).equals(town.files.get(`${view.id}/${layer.name}/${tileName(tile)}`) as Uint8Array),
          ).toBe(true);
          tiles++;
        }
      }
    }
    expect(tiles).toBe([...town.files.keys()].filter((path) => !path.startsWith("objects/")).length);
  });

  test("has objects, and null for a file that is not there", async () => {
    expect(await source.json("objects/search.json")).toMatchObject({ map3d: "search" });
    expect(await source.json("objects/77.json")).toBeNull();
  });
});

test("only the bytes of the tile and the directories are read", async () => {
  const read: number[] = [];
  const files = chosen(archived).map((file) => {
    if (!file.name.endsWith(".pmtiles")) return file;
    file.arrayBuffer = () => Promise.reject(new Error("a whole archive was read"));
    const slice = file.slice.bind(file);
    file.slice = (from = 0, to = 0) => {
      read.push(to - from);
      return slice(from, to);
    };
    return file;
  });
  const source = filesSource(files);
  const { views, json } = await source.manifest();
  const [view, layer] = [[...views.values()][0], json.layers[0]];
  if (!view || !layer) throw new Error("the town has no views");
  const bytes = (await source.tile(view, layer, { z: 0, x: 0, y: 0 })) as ArrayBuffer | null;
  expect(read).toEqual([16384, bytes?.byteLength]);
});

describe("an incomplete rendering is rejected with a message", () => {
  const rows: [string, () => unknown, RegExp, string?][] = [
    ["nothing", () => filesSource([]), /it has no rendering\.json/, "none"],
    ["a picture", () => filesSource([new File(["x"], "cat.jpg")]), /no rendering\.json/, "none"],
    [
      "two folders",
      () => filesSource([...chosen(town, "a/"), ...chosen(town, "b/")]),
      /several maps: a\/rendering\.json, b\/rendering\.json/,
      "several",
    ],
    ["another JSON", () => filesSource([new File(["{}"], "rendering.json")]).manifest(), /"map3d": "rendering" is missing/],
    [
      "no JSON",
      () => filesSource([new File(["<html>"], "rendering.json")]).manifest(),
      /rendering\.json: expected JSON, got 6 bytes of invalid JSON/,
    ],
    [
      "without an archive",
      () => filesSource(chosen(archived).filter((file) => !file.webkitRelativePath.endsWith("90-45/id.pmtiles"))).manifest(),
      /missing: 90-45\/id\.pmtiles\. Choose the complete folder/,
      "missing",
    ],
    [
      "without most archives",
      () => filesSource(chosen(archived).filter((file) => !file.name.endsWith(".pmtiles"))).manifest(),
      /missing: 0-45\/color\.pmtiles, 0-45\/normal\.pmtiles, 0-45\/id\.pmtiles, … \(16\)/,
      "missing",
    ],
  ];
  test.each(rows)("%s", async (_, act, message, problem) => {
    const error = (await refusal(act)) as Error;
    expect(error.message).toMatch(message);
    expect((error as { problem?: string }).problem).toBe(problem);
  });

  test("a file that has changed since it was opened", async () => {
    const gone = Object.assign(new Blob(), { arrayBuffer: () => Promise.reject(new DOMException("changed", "NotReadableError")) });
    const error = (await refusal(() => filesSource({ file: () => Promise.resolve(gone) }).manifest())) as Error;
    expect(error.message).toContain("rendering.json has changed or moved");
  });

  test("a truncated archive, or one with invalid part sizes", async () => {
    const cut = chosen(archived).map((file) =>
      file.name === "color.pmtiles"
        ? Object.defineProperty(new File([file.slice(0, 300)], file.name), "webkitRelativePath", { value: file.webkitRelativePath })
        : file,
    );
    const source = filesSource(cut);
    const { views, json } = await source.manifest();
    const error = (await refusal(() =>
      source.tile([...views.values()][0] as never, json.layers[0] as never, { z: 3, x: 3, y: 3 }),
    )) as Error;
    expect(error.message).toMatch(
      /0-45\/color\.pmtiles: (expected \d+ bytes at \d+, but the file has 300 bytes; copy the file again|not a PMTiles)|is truncated/,
    );
  });
});

test("paths out of the folder are not found", async () => {
  for (const path of ["../secret", "/etc/passwd", "a/../../b", "https://evil.example/x", "a//b", "a\\b", "", ".", "c:x", "a\0"])
    expect(isInside(path), path).toBe(false);
  for (const path of ["rendering.json", "0-45/color.pmtiles", "45-22.5/id/0/0/0", "objects/columns/0f.json"])
    expect(isInside(path), path).toBe(true);
  const asked: string[] = [];
  const views = archived.json.views.map((view) => ({
    ...view,
    archives: { color: "https://evil.example/x.pmtiles", id: "../../id.pmtiles" },
  }));
  const source = filesSource({
    file: (path) => {
      asked.push(path);
      return Promise.resolve(path === "rendering.json" ? new Blob([JSON.stringify({ ...archived.json, views })]) : new Blob(["x"]));
    },
  });
  expect(((await refusal(() => source.manifest())) as Error).message).toContain(
    "missing: https://evil.example/x.pmtiles, ../../id.pmtiles",
  );
  expect(asked).toEqual(["rendering.json"]);
});

test("manifests below another manifest's folder are ignored", () => {
  expect(findManifestFolders(["rendering.json", "a/rendering.json"])).toEqual([""]);
  expect(findManifestFolders(["x/a/rendering.json", "x/a/b/rendering.json", "x/c/rendering.json", "x/notrendering.json"])).toEqual([
    "x/a/",
    "x/c/",
  ]);
});

test("an HTTP source uses the given fetch function", async () => {
  vi.stubGlobal("document", { baseURI: "https://host.example/page/" });
  const asked: string[] = [];
  const source = new HttpSource(["/town/", "https://other.example/town"], (url) => {
    asked.push(url);
    return Promise.resolve(new Response(JSON.stringify(town.json)));
  });
  expect((await source.manifest()).json.name).toBe("town");
  expect(source.bases).toEqual(["https://host.example/town", "https://other.example/town"]);
  expect(asked).toEqual(["https://host.example/town/rendering.json"]);
});

function levels(zmax: number): Tile[] {
  return Array.from({ length: zmax + 1 }, (_, z) =>
    Array.from({ length: 4 ** z }, (__, k) => ({ z, x: k % 2 ** z, y: Math.floor(k / 2 ** z) })),
  ).flat();
}

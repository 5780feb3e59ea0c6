import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { deflateSync, inflateSync } from "node:zlib";
import { describe, expect, test } from "vitest";
import { decodeDataTile, type DataTile } from "../../src/core/dataTile";
import { DecodeError } from "../../src/core/errors";

interface TileVector {
  name: string;
  base64: string;
  width: number;
  height: number;
  normal: number[];
  id: number[];
  depth: number[];
}

const vectors = JSON.parse(readFileSync(resolve(import.meta.dirname, "../../../spec/vectors/data-tiles.json"), "utf8")) as {
  tiles: TileVector[];
  refused: { why: string; base64: string }[];
};

const bytesOf = (base64: string): Uint8Array<ArrayBuffer> => new Uint8Array(Buffer.from(base64, "base64"));

const KINDS = ["normal", "id", "depth"] as const;
const decodeAll = async (bytes: Uint8Array<ArrayBuffer>): Promise<DataTile[]> => [
  await decodeDataTile(bytes, KINDS[0]),
  await decodeDataTile(bytes, KINDS[1]),
  await decodeDataTile(bytes, KINDS[2]),
];

/** Changes a body and deflates it again. */
const packed = (tile: Uint8Array, change: (body: Uint8Array) => void): Uint8Array<ArrayBuffer> => {
  const body = new Uint8Array(inflateSync(tile.subarray(24)));
  change(body);
  return new Uint8Array(Buffer.concat([tile.subarray(0, 24), deflateSync(body)]));
};

describe("data tile", () => {
  for (const { name, base64, width, height, normal, id, depth } of vectors.tiles) {
    test(`${name}: decodes to the pixels of the specification`, async () => {
      for (const bytes of [bytesOf(base64), packed(bytesOf(base64), () => undefined)]) {
        const tile = await decodeAll(bytes);
        for (const part of tile) expect([part.width, part.height]).toEqual([width, height]);
        expect(tile.map(({ kind }) => kind)).toEqual(["normal", "id", "depth"]);
        expect([...(tile[1]?.values ?? [])]).toEqual(id);
        expect([...(tile[2]?.values ?? [])]).toEqual(depth);
        expect([...(tile[0]?.values ?? [])]).toEqual(normal.flatMap((n) => [n & 255, (n >> 8) & 255, n >> 16]));
      }
    });
  }

  for (const { why, base64 } of vectors.refused) {
    test(`${why}: is refused`, async () => {
      await expect(decodeAll(bytesOf(base64))).rejects.toThrow(DecodeError);
    });
  }

  test("another version is refused with both numbers", async () => {
    const bytes = bytesOf(vectors.refused.find(({ why }) => why === "version 2")?.base64 ?? "");
    await expect(decodeAll(bytes)).rejects.toThrow(/version 1, not 2/);
  });

  test("changed bytes are refused or give a tile of the same size", async () => {
    const { base64, width, height } = vectors.tiles.find(({ name }) => name === "bumps on planes") as TileVector;
    let [state, refused, read] = [1, 0, 0];
    const draw = (n: number): number => ((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) >>> 8) % n;
    for (let k = 0; k < 300; k++) {
      const bytes = packed(bytesOf(base64), (body) => {
        for (let n = draw(3); n >= 0; n--) body[draw(body.length)] = [0, 255, draw(256)][draw(3)] ?? 0;
      });
      if (k % 4 === 0) bytes[8 + draw(16)] = draw(256);
      try {
        const tile = await decodeAll(bytes);
        read++;
        expect(tile.map(({ values }) => values.length)).toEqual([3 * width * height, width * height, width * height]);
      } catch (reason) {
        expect(reason).toBeInstanceOf(DecodeError);
        refused++;
      }
    }
    expect(Math.min(refused, read)).toBeGreaterThan(30);
  });
});

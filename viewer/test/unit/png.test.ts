import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { deflateSync } from "node:zlib";
import { describe, expect, test } from "vitest";
import { decodePng } from "../../src/core/png";
import { decodeTile } from "../../src/tiles/tileData";
import { DecodeError } from "../../src/core/errors";
import { encodePng } from "../fixture/encodePng";

function noise(length: number, seed: number): Uint8Array {
  let state = seed;
  return Uint8Array.from({ length }, () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) >>> 24);
}

describe("PNG", () => {
  for (const channels of [1, 2, 3, 4] as const) {
    for (const filter of [0, 1, 2, 3, 4, "mixed"] as const) {
      test(`${String(channels)} channels, filter ${String(filter)}: random bytes are restored bit for bit`, async () => {
        const [width, height] = [37, 29];
        const data = noise(width * height * channels, 7 * channels);
        const made = await decodePng(encodePng(width, height, channels, data, (row) => (filter === "mixed" ? row % 5 : filter)));
        expect(made).toMatchObject({ width, height, channels });
        expect(Buffer.from(made.data).equals(Buffer.from(data))).toBe(true);
      });
    }
  }

  test("one pixel", async () => {
    expect([...(await decodePng(encodePng(1, 1, 4, Uint8Array.of(1, 2, 3, 0), () => 4))).data]).toEqual([1, 2, 3, 0]);
  });

  test("pixels split over several IDAT chunks are joined", async () => {
    const whole = Buffer.from(encodePng(16, 16, 3, noise(768, 3)));
    const at = whole.indexOf("IDAT") - 4;
    const length = whole.readUInt32BE(at);
    const body = whole.subarray(at + 8, at + 8 + length);
    const part = (bytes: Buffer): Buffer => {
      const head = Buffer.alloc(8);
      head.writeUInt32BE(bytes.length);
      head.write("IDAT", 4);
      return Buffer.concat([head, bytes, Buffer.alloc(4)]);
    };
    const split = Buffer.concat([
      whole.subarray(0, at),
      part(body.subarray(0, 5)),
      part(body.subarray(5)),
      whole.subarray(at + 12 + length),
    ]);
    expect([...(await decodePng(new Uint8Array(split))).data]).toEqual([...noise(768, 3)]);
  });
});

describe("an unsupported PNG is refused", () => {
  const good = encodePng(8, 8, 4, noise(256, 1));
  const changed = (at: number, value: number): Uint8Array<ArrayBuffer> => {
    const copy = good.slice();
    copy[at] = value;
    return copy;
  };
  const withPixels = (raw: Uint8Array): Uint8Array<ArrayBuffer> => {
    const body = deflateSync(raw);
    const head = Buffer.alloc(8);
    head.writeUInt32BE(body.length);
    head.write("IDAT", 4);
    return new Uint8Array(Buffer.concat([good.subarray(0, 33), head, body, Buffer.alloc(4)]));
  };
  test.each([
    ["empty", new Uint8Array(0), /not a PNG/],
    ["a JPEG", Uint8Array.of(0xff, 0xd8, 0xff), /not a PNG/],
    ["cut off", good.slice(0, 60), /is truncated/],
    ["no pixels", good.slice(0, 33), /no IHDR or no IDAT/],
    ["16 bits", changed(24, 16), /16 bits/],
    ["palette", changed(25, 3), /colour type 3/],
    ["interlaced", changed(28, 1), /interlace 1/],
    ["huge", changed(16, 0x7f), /expected 1 to 4096/],
    ["no width", changed(19, 0), /PNG of 0 × 8/],
    ["too few pixels", withPixels(new Uint8Array(100)), /does not have the 264 bytes/],
    ["too many pixels", withPixels(new Uint8Array(265)), /does not have the 264 bytes/],
    ["unknown filter", withPixels(new Uint8Array(264).fill(9)), /filter 9/],
    ["broken stream", changed(45, 0xff), /zlib|264 bytes|filter/],
  ])("%s", async (_, bytes, message) => {
    const reason: unknown = await decodePng(bytes).catch((error: unknown) => error);
    expect(reason).toBeInstanceOf(DecodeError);
    expect(String(reason)).toMatch(message);
  });
});

describe("data", () => {
  const file = JSON.parse(readFileSync(resolve(import.meta.dirname, "../../../spec/vectors/data.json"), "utf8")) as {
    uint32: { value: number; rgba: number[] }[];
    normal: { rgb: number[] }[];
  };

  test.each(["id", "depth"])("%s values match the vectors", async (kind) => {
    const bytes = Uint8Array.from(file.uint32.flatMap(({ rgba }) => rgba));
    const tile = await decodeTile(kind, "image/png", encodePng(file.uint32.length, 1, 4, bytes).buffer);
    expect(tile.kind === "id" || tile.kind === "depth" ? [...tile.values] : []).toEqual(file.uint32.map(({ value }) => value));
  });

  test("normals keep the bytes of the vectors", async () => {
    const bytes = Uint8Array.from(file.normal.flatMap(({ rgb }) => rgb));
    const tile = await decodeTile("normal", "image/png", encodePng(file.normal.length, 1, 3, bytes).buffer);
    expect(tile.kind === "normal" ? [...tile.values] : []).toEqual([...bytes]);
  });

  test.each([1, 2] as const)("a tile of %i bytes per pixel is refused for kinds that have 3 or 4", async (channels) => {
    for (const kind of ["normal", "id", "depth"]) {
      await expect(decodeTile(kind, "image/png", encodePng(1, 1, channels, new Uint8Array(channels)).buffer)).rejects.toThrow(DecodeError);
    }
  });

  test("an id tile without alpha is refused", async () => {
    await expect(decodeTile("id", "image/png", encodePng(1, 1, 3, new Uint8Array(3)).buffer)).rejects.toThrow(
      /id tiles have 4 bytes per pixel, got 3/,
    );
  });
});

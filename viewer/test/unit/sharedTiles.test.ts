import { describe, expect, test } from "vitest";
import type { LayerInfo, View } from "../../src/geo/manifest";
import { Cache } from "../../src/tiles/cache";
import type { Decoder } from "../../src/tiles/decoder";
import { LayerTiles, type CachedTile } from "../../src/tiles/layerTiles";
import { RequestQueue } from "../../src/tiles/queue";
import type { Source } from "../../src/tiles/source";
import { DATA_TYPE } from "../../src/tiles/tileData";

const VIEW = { id: "0-45", occupancy: { has: () => true } } as unknown as View;
const TILE = { z: 1, x: 0, y: 1 };
const [NORMAL, ID, DEPTH] = ["normal", "id", "depth"].map((kind): LayerInfo => ({
  name: "data",
  kind,
  format: "m3d",
  media_type: DATA_TYPE,
})) as [LayerInfo, LayerInfo, LayerInfo];

/** Tiles whose source answers when told; the decoder says what it was given. */
function open(): {
  layer: LayerTiles;
  queue: RequestQueue;
  answers: ((bytes: ArrayBuffer | Error | null) => void)[];
  decoded: string[];
  errors: Error[];
} {
  const [answers, decoded, errors]: [((bytes: ArrayBuffer | Error | null) => void)[], string[], Error[]] = [[], [], []];
  const source = {
    tile: (_view: unknown, _layer: unknown, _tile: unknown, signal: AbortSignal) =>
      new Promise<ArrayBuffer | null>((resolve, reject) => {
        signal.addEventListener("abort", () => {
          reject(signal.reason as Error);
        });
        answers.push((bytes) => {
          if (bytes instanceof Error) reject(bytes);
          else resolve(bytes);
        });
      }),
  } as unknown as Source;
  const decoder = {
    decode: (kind: string, _type: string, bytes: ArrayBuffer, keep: boolean) => {
      decoded.push(`${kind} ${String(bytes.byteLength)} ${String(keep)}`);
      return Promise.resolve({ kind, width: 1, height: 1, values: new Uint32Array(1) });
    },
  } as unknown as Decoder;
  const queue = new RequestQueue(12);
  const layer = new LayerTiles("layer0", source, { cache: new Cache<CachedTile>(1e6, () => undefined), queue, decoder }, (error) => {
    if (error) errors.push(error);
  });
  return { layer, queue, answers, decoded, errors };
}

const turn = (): Promise<void> => new Promise((done) => setTimeout(done));

describe("data tile", () => {
  test("requests for its kinds share one fetch, and later ones decode the bytes that were kept", async () => {
    const { layer, answers, decoded } = open();
    const both = Promise.all([layer.fetch(VIEW, NORMAL, TILE), layer.fetch(VIEW, DEPTH, TILE)]);
    await turn();
    expect(answers.length).toBe(1);
    answers[0]?.(new ArrayBuffer(7));
    expect((await both).map((data) => data?.kind)).toEqual(["normal", "depth"]);
    layer.releaseData(VIEW, NORMAL, TILE);
    expect((await layer.fetch(VIEW, ID, TILE))?.kind).toBe("id");
    expect((await layer.fetch(VIEW, NORMAL, TILE))?.kind).toBe("normal");
    expect(answers.length).toBe(1);
    expect(decoded.sort()).toEqual(["depth 7 true", "id 7 true", "normal 7 true", "normal 7 true"]);
  });

  test("a request that shares the fetch of an aborted one fetches for itself", async () => {
    const { layer, queue, answers, errors } = open();
    queue.setRequests([layer.makeRequest(VIEW, NORMAL, TILE), layer.makeRequest(VIEW, DEPTH, TILE)]);
    await turn();
    queue.setRequests([layer.makeRequest(VIEW, DEPTH, TILE)]);
    await turn();
    expect(answers.length).toBe(2);
    answers[1]?.(new ArrayBuffer(3));
    await turn();
    expect(layer.get(VIEW, DEPTH, TILE)?.data?.kind).toBe("depth");
    expect(layer.get(VIEW, NORMAL, TILE)).toBeUndefined();
    expect(errors).toEqual([]);
  });

  test("a failure fails all that share it, without another request", async () => {
    const { layer, answers } = open();
    const both = Promise.allSettled([layer.fetch(VIEW, NORMAL, TILE), layer.fetch(VIEW, ID, TILE)]);
    await turn();
    answers[0]?.(new TypeError("no response"));
    expect((await both).map(({ status }) => status)).toEqual(["rejected", "rejected"]);
    expect(answers.length).toBe(1);
  });

  test("an empty tile is empty for all kinds", async () => {
    const { layer, answers } = open();
    const both = Promise.all([layer.fetch(VIEW, NORMAL, TILE), layer.fetch(VIEW, ID, TILE)]);
    await turn();
    answers[0]?.(null);
    expect(await both).toEqual([null, null]);
    expect(answers.length).toBe(1);
  });
});

import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";
import type { Tile } from "../../src/geo/frame";
import type { LayerInfo, View } from "../../src/geo/manifest";
import { Cache } from "../../src/tiles/cache";
import type { Decoder } from "../../src/tiles/decoder";
import { LayerTiles, type CachedTile } from "../../src/tiles/layerTiles";
import { HttpSource } from "../../src/tiles/source";
import { RequestQueue } from "../../src/tiles/queue";

const LAYER = { name: "color", kind: "color", media_type: "image/png" } as LayerInfo;
const VIEW = { id: "0-45", occupancy: { has: () => true }, versionOf: () => 1 } as unknown as View;
const TILES: readonly Tile[] = Array.from({ length: 148 }, (_, k) => ({ z: 4, x: k % 16, y: Math.floor(k / 16) }));
type Answer = "silence" | "tile" | "missing";

/** A screen full of tiles that are drawn, and requested, as in a map. */
function openScreen(answers: { now: Answer }): {
  requests: string[];
  errors: Error[];
  loaded: () => number;
  online: () => void;
  pan: () => void;
} {
  const [requests, errors] = [[] as string[], [] as Error[]];
  const respond = (url: string): Promise<Response> => {
    requests.push(url);
    if (answers.now === "silence") return Promise.reject(new TypeError("Failed to fetch"));
    return Promise.resolve(new Response(new Uint8Array(4), { status: answers.now === "tile" ? 200 : 404 }));
  };
  const queue = new RequestQueue(12);
  const cache = new Cache<CachedTile>(1e9, () => undefined);
  const decoder = {
    decode: () => Promise.resolve({ kind: "color", width: 1, height: 1, bitmap: { close: () => undefined } }),
  } as unknown as Decoder;
  const source = new HttpSource("http://host/town", respond);
  let requested = false;
  const frame = (): void => {
    requested = false;
    queue.setRequests(
      TILES.filter((tile) => !layer.get(VIEW, LAYER, tile) && !layer.hasFailed(VIEW, LAYER, tile)).map((tile) =>
        layer.makeRequest(VIEW, LAYER, tile),
      ),
    );
  };
  const requestFrame = (): void => {
    if (!requested) setTimeout(frame, 16);
    requested = true;
  };
  const layer = new LayerTiles("layer0", source, { cache, queue, decoder }, (error) => {
    if (error) errors.push(error);
    requestFrame();
  });
  requestFrame();
  return {
    requests,
    errors,
    loaded: () => cache.size,
    pan: requestFrame,
    online: () => {
      layer.clearFailures();
      requestFrame();
    },
  };
}

describe("when the network goes", () => {
  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal("document", { baseURI: "http://host/" });
  });
  afterEach(() => {
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  test("an unreachable server is asked less and less often: growing waits, and one request after each", async () => {
    const answers: { now: Answer } = { now: "silence" };
    const screen = openScreen(answers);
    await vi.advanceTimersByTimeAsync(20_000);
    expect(screen.requests.length).toBeLessThanOrEqual(4 * 12 + 4 * 5);
    const before = screen.requests.length;
    await vi.advanceTimersByTimeAsync(600_000);
    expect(screen.requests.length - before).toBeLessThanOrEqual(4 * 8);
    expect(screen.errors).toHaveLength(1);
    answers.now = "tile";
    await vi.advanceTimersByTimeAsync(240_000);
    expect(screen.loaded()).toBe(TILES.length);
  });

  test("a device without a network asks once, and again when it is online", async () => {
    const device = { onLine: false };
    vi.stubGlobal("navigator", device);
    const answers: { now: Answer } = { now: "silence" };
    const screen = openScreen(answers);
    await vi.advanceTimersByTimeAsync(20_000);
    for (let k = 0; k < 100; k++) {
      screen.pan();
      await vi.advanceTimersByTimeAsync(600);
    }
    expect(screen.requests.length).toBeLessThanOrEqual(12);
    expect(screen.errors).toHaveLength(1);
    Object.assign(device, { onLine: true });
    answers.now = "tile";
    screen.online();
    await vi.advanceTimersByTimeAsync(1000);
    expect(screen.loaded()).toBe(TILES.length);
  });

  test("without a network, a service worker is asked for every tile, once", async () => {
    vi.stubGlobal("navigator", { onLine: false, serviceWorker: { controller: {} } });
    const screen = openScreen({ now: "silence" });
    for (let k = 0; k < 100; k++) {
      screen.pan();
      await vi.advanceTimersByTimeAsync(600);
    }
    expect(screen.requests.length).toBe(TILES.length);
    expect(screen.errors).toHaveLength(1);
  });

  test("missing tiles keep no other tile waiting, and one error is reported for all", async () => {
    const screen = openScreen({ now: "missing" });
    await vi.advanceTimersByTimeAsync(5000);
    expect(screen.requests.length).toBe(TILES.length);
    expect(screen.errors).toMatchObject([{ name: "FetchError", status: 404 }]);
  });
});

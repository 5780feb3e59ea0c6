import { afterEach, describe, expect, test, vi } from "vitest";
import { PMTiles, zxyToTileId, type Source as PmSource } from "pmtiles";
import { gzipSync } from "node:zlib";
import { makeFrame, type Tile } from "../../src/geo/frame";
import { MAP_OPTIONS } from "../../src/map/options";
import { Cache, computeCacheBytes } from "../../src/tiles/cache";
import { findCover, sortFromCenter, computeLevel, findFallbacks, type Rect } from "../../src/tiles/cover";
import { fetchBytes, type FetchFunction } from "../../src/tiles/fetch";
import { Archive, tileId, type ReadRange } from "../../src/tiles/pmtiles";
import { RequestQueue, type TileRequest } from "../../src/tiles/queue";
import { normalizeBaseUrl, chooseHost, tileUrl, tileUrls } from "../../src/tiles/url";

const frame = makeFrame({ id: "0-45", look_at_deg: 0, pitch_deg: 45, u0_m: -512, v0_m: 512, d0_m: 0 }, 1024, 256, 4);
const area = ({ z }: Tile): number => (frame.size / 2 ** z) ** 2;

describe("cover", () => {
  const rect: Rect = [
    [-100.5, -333],
    [260.25, 120],
  ];

  test.each([0, 1, 2, 3, 4])("tiles of level %i partition the viewport", (level) => {
    const tiles = findCover(frame, () => true, level, rect);
    const tile_m = frame.size / 2 ** level;
    for (let k = 0; k < 400; k++) {
      const [u, v] = [
        rect[0][0] + ((k * 0.618) % 1) * (rect[1][0] - rect[0][0]),
        rect[0][1] + ((k * 0.414) % 1) * (rect[1][1] - rect[0][1]),
      ];
      const holding = tiles.filter(
        ({ x, y }) =>
          u >= frame.u0 + x * tile_m && u < frame.u0 + (x + 1) * tile_m && v <= frame.v0 - y * tile_m && v > frame.v0 - (y + 1) * tile_m,
      );
      expect(holding).toHaveLength(1);
    }
    for (const { x, y } of tiles) {
      expect(frame.u0 + (x + 1) * tile_m > rect[0][0] && frame.u0 + x * tile_m < rect[1][0]).toBe(true);
      expect(frame.v0 - y * tile_m > rect[0][1] && frame.v0 - (y + 1) * tile_m < rect[1][1]).toBe(true);
    }
  });

  test("no tile is outside the occupancy or the square", () => {
    const occupied = ({ x, y }: Tile): boolean => (x + y) % 2 === 0;
    const tiles = findCover(frame, occupied, 3, [
      [-5000, -5000],
      [5000, 5000],
    ]);
    expect(tiles).toHaveLength(32);
    expect(tiles.every(occupied)).toBe(true);
  });

  test("a viewport outside the square has no tiles", () => {
    expect(
      findCover(frame, () => true, 4, [
        [600, 600],
        [700, 700],
      ]),
    ).toEqual([]);
  });

  test("tiles at the centre come first", () => {
    const ordered = sortFromCenter(
      frame,
      findCover(frame, () => true, 2, [
        [-512, -512],
        [512, 512],
      ]),
      [
        [256, 256],
        [512, 512],
      ],
    );
    expect(ordered[0]).toEqual({ z: 2, x: 3, y: 0 });
  });
});

describe("level", () => {
  test.each([
    [1, 1, 2],
    [0.5, 1, 3],
    [0.7, 1, 3],
    [0.72, 1, 2],
    [0.01, 1, 4],
    [1000, 1, 0],
  ])("a device pixel of %d m at ratio %d shows level %d", (px, dpr, level) => {
    expect(computeLevel(frame, px, dpr)).toBe(level);
  });

  test("on dense screens a tile pixel covers one to two device pixels", () => {
    for (let zoom = 0.05; zoom < 4; zoom += 0.05) {
      const device = 4 / 2 ** zoom;
      const scale = 4 / 2 ** computeLevel(frame, device, 3) / device;
      expect(scale).toBeGreaterThan(0.999);
      expect(scale).toBeLessThan(2.001);
    }
  });
});

describe("fallbacks", () => {
  const all = (): boolean => true;
  const only =
    (...names: string[]) =>
    ({ z, x, y }: Tile): boolean =>
      names.includes(`${String(z)}/${String(x)}/${String(y)}`);
  const tile = { z: 3, x: 5, y: 2 };

  test("a ready tile is drawn itself", () => {
    expect(findFallbacks(tile, all, all)).toEqual([{ area: tile, from: tile }]);
  });

  test("otherwise the nearest ancestor is drawn", () => {
    expect(findFallbacks(tile, only("1/1/0", "0/0/0"), all)).toEqual([{ area: tile, from: { z: 1, x: 1, y: 0 } }]);
  });

  test("ready children precede ancestors; together they fill the tile exactly once", () => {
    const stands = findFallbacks(tile, only("4/10/4", "5/23/11", "1/1/0"), all);
    expect(stands.reduce((sum, stand) => sum + area(stand.area), 0)).toBeCloseTo(area(tile), 6);
    expect(stands.map(({ from }) => from.z).sort()).toEqual([1, 1, 1, 1, 1, 4, 5].sort());
  });

  test("without ready tiles nothing is drawn", () => {
    expect(findFallbacks(tile, () => false, all)).toEqual([]);
  });
});

describe("cache", () => {
  test("never exceeds its limit after a tick", () => {
    const dropped: string[] = [];
    const cache = new Cache<number>(100, (key) => dropped.push(key));
    for (let k = 0; k < 50; k++) {
      cache.startTick();
      cache.set(String(k), k, 7 + (k % 5));
      expect(cache.bytes).toBeLessThanOrEqual(100);
    }
    expect(dropped.length + cache.size).toBe(50);
    expect(dropped[0]).toBe("0");
  });

  test("keeps the most recently used values and never drops those in use", () => {
    const cache = new Cache<number>(30, () => undefined);
    cache.set("a", 1, 10);
    cache.set("b", 2, 10);
    cache.set("c", 3, 10);
    cache.startTick();
    cache.get("a");
    cache.set("d", 4, 10);
    expect([cache.peek("a"), cache.peek("b"), cache.peek("d")]).toEqual([1, undefined, 4]);
    cache.set("e", 5, 100);
    expect(cache.peek("a")).toBe(1);
    expect(cache.bytes).toBe(120);
    cache.startTick();
    cache.startTick();
    expect(cache.bytes).toBeLessThanOrEqual(30);
  });

  test("keeps values in use tick after tick, even beyond the limit", () => {
    const dropped: string[] = [];
    const cache = new Cache<number>(30, (key) => dropped.push(key));
    for (const key of ["a", "b", "c", "d", "e"]) cache.set(key, 1, 20);
    for (let k = 0; k < 3; k++) {
      cache.startTick();
      for (const key of ["e", "d", "c", "b", "a"]) expect(cache.get(key)).toBe(1);
    }
    cache.startTick();
    cache.get("c");
    cache.startTick();
    expect([dropped.length, cache.peek("c")]).toEqual([4, 1]);
  });

  test("replaces a value and its bytes when it is set again", () => {
    const cache = new Cache<number>(100, () => undefined);
    cache.set("a", 1, 60);
    cache.set("a", 2, 20);
    expect([cache.bytes, cache.peek("a")]).toEqual([20, 2]);
    cache.delete("a");
    cache.delete("a");
    expect(cache.bytes).toBe(0);
  });
});

describe("URLs", () => {
  test("a tile's URL matches the specification", () => {
    expect(tileUrl("https://a.example/tiles/teatime", "45-22.5", "color", { z: 3, x: 1, y: 6 }, 4)).toBe(
      "https://a.example/tiles/teatime/45-22.5/color/3/1/6?v=4",
    );
  });

  test.each([
    ["http://t1/tiles/teatime/", "http://t1/tiles/teatime"],
    [".", "http://p/a"],
    ["", "http://p/a"],
    ["../b", "http://p/b"],
    ["/c/?x=1#y", "http://p/c"],
  ])("base %s", (url, want) => {
    expect(normalizeBaseUrl(url, "http://p/a/index.html")).toBe(want);
  });

  test("a tile always has the same host, its neighbours have others, and all hosts are used", () => {
    const hosts = [0, 1, 2, 3].map((x) => chooseHost({ z: 5, x, y: 9 }, 4));
    expect(new Set(hosts).size).toBe(4);
    expect(chooseHost({ z: 5, x: 2, y: 9 }, 4)).toBe(hosts[2]);
    expect(chooseHost({ z: 5, x: 2, y: 10 }, 4)).not.toBe(hosts[2]);
    expect(new Set(tileUrls(["http://a", "http://b"], "0-45", "id", { z: 0, x: 0, y: 0 }, 1)).size).toBe(2);
  });
});

describe("cache size", () => {
  test.each([
    ["a phone", 390, 844, 3],
    ["a phone", 390, 844, 2],
    ["a tablet", 820, 1180, 2],
    ["a laptop", 1440, 900, 2],
    ["a desk", 1920, 1080, 1],
  ])("the cache of %s, %i × %i at %i, holds the tiles of three views", (_, width, height, dpr) => {
    const finer = Math.min(0, Math.log2(MAP_OPTIONS.maxTileRatio[0] / dpr));
    const finest = dpr > 1 ? dpr * 2 ** finer : Math.SQRT2; // tile pixels per CSS pixel: see computeLevel
    const view_bytes = (width * finest + 256) * (height * finest + 256) * 7; // colours and normals
    expect(computeCacheBytes({ dpr, finer }, width * height * dpr ** 2)).toBeGreaterThan(3 * view_bytes);
  });
});

describe("fetch", () => {
  afterEach(() => {
    vi.unstubAllGlobals();
  });
  const answers = (...list: (number | Error)[]): string[] => {
    const asked: string[] = [];
    vi.stubGlobal("fetch", (url: string) => {
      asked.push(url);
      const next = list.shift() ?? 200;
      return next instanceof Error ? Promise.reject(next) : Promise.resolve(new Response(next === 204 ? null : "ok", { status: next }));
    });
    return asked;
  };

  test("transient failures are retried at the next host", async () => {
    const asked = answers(503, new TypeError("reset"), 200);
    expect((await fetchBytes(["a", "b"], { backoff_ms: 1 }))?.byteLength).toBe(2);
    expect(asked).toEqual(["a", "b", "a"]);
  });

  test("404 is final, 204 means empty", async () => {
    const asked = answers(404, 204);
    await expect(fetchBytes(["a"], { backoff_ms: 1 })).rejects.toMatchObject({ status: 404 });
    expect(await fetchBytes(["a"])).toBeNull();
    expect(asked).toHaveLength(2);
  });

  test("the number of attempts is limited", async () => {
    const asked = answers(500, 500, 500, 500);
    await expect(fetchBytes(["a"], { backoff_ms: 1, attempts: 3 })).rejects.toThrow("HTTP 500");
    expect(asked).toHaveLength(3);
  });

  test("an abort ends the wait", async () => {
    answers(503);
    const abort = new AbortController();
    const fetching = fetchBytes(["a"], { backoff_ms: 60_000, signal: abort.signal });
    setTimeout(() => {
      abort.abort();
    }, 5);
    await expect(fetching).rejects.toMatchObject({ name: "AbortError" });
  });

  test("a server that ignores range requests is reported", async () => {
    answers(200);
    await expect(fetchBytes(["a"], { range: [0, 5] })).rejects.toThrow(/ignores range/);
  });

  test("a range that ends early is requested again, past the browser's cache; the first may be longer than the file", async () => {
    const caches: (RequestCache | undefined)[] = [];
    const lengths = [3, 5, 3];
    const request: FetchFunction = (_, { cache }) => {
      caches.push(cache);
      return Promise.resolve(new Response(new Uint8Array(lengths.shift() ?? 0), { status: 206 }));
    };
    expect((await fetchBytes(["a"], { range: [7, 5], backoff_ms: 1, fetch: request }))?.byteLength).toBe(5);
    expect(caches).toEqual(["default", "reload"]);
    expect((await fetchBytes(["a"], { range: [0, 5], fetch: request }))?.byteLength).toBe(3);
    await expect(fetchBytes(["a"], { range: [7, 5], backoff_ms: 1, attempts: 2, fetch: request })).rejects.toThrow("a: 0 of 5 bytes");
  });
});

describe("queue", () => {
  const world = (): { started: string[]; aborted: string[]; end: Map<string, () => void>; job: (key: string) => TileRequest } => {
    const [started, aborted, end] = [[] as string[], [] as string[], new Map<string, () => void>()];
    const job = (key: string): TileRequest => ({
      key,
      run: (signal) => {
        started.push(key);
        signal.addEventListener("abort", () => aborted.push(key));
        return new Promise((done) => end.set(key, done));
      },
    });
    return { started, aborted, end, job };
  };
  const turn = (): Promise<void> => new Promise((done) => setTimeout(done, 0));

  test("runs requests in order, each once, and not more than the limit at once", async () => {
    const { started, end, job } = world();
    const queue = new RequestQueue(2);
    queue.setRequests(["a", "b", "a", "c"].map(job));
    expect(started).toEqual(["a", "b"]);
    end.get("a")?.();
    await turn();
    expect(started).toEqual(["a", "b", "c"]);
  });

  test("aborts requests that are no longer wanted, unless a caller waits for them", () => {
    const { started, aborted, job } = world();
    const queue = new RequestQueue(4);
    queue.setRequests([job("a"), job("b")]);
    void queue.runNow(job("b"));
    queue.setRequests([job("c")]);
    expect([started, aborted]).toEqual([["a", "b", "c"], ["a"]]);
  });

  test("is busy until all requests have ended", async () => {
    const { end, job } = world();
    const queue = new RequestQueue(1);
    expect(queue.busy).toBe(false);
    queue.setRequests([job("a")]);
    expect(queue.busy).toBe(true);
    end.get("a")?.();
    await turn();
    expect(queue.busy).toBe(false);
  });
});

describe("PMTiles", () => {
  test("tile ids match the reference reader up to level 26", () => {
    for (let z = 0; z <= 26; z++) {
      for (const [a, b] of [
        [0, 0],
        [0.3, 0.9],
        [0.77, 0.11],
        [0.999999, 0.999999],
      ] as const) {
        const [x, y] = [Math.floor(a * 2 ** z), Math.floor(b * 2 ** z)];
        expect(tileId({ z, x, y })).toBe(zxyToTileId(z, x, y));
      }
    }
  });

  /** An archive of level 2's 16 tiles with one leaf directory; the last four tiles share one content. */
  function archive(): Uint8Array<ArrayBuffer> {
    const varint = (value: number): number[] => (value < 128 ? [value] : [(value % 128) | 128, ...varint(Math.floor(value / 128))]);
    const directory = (rows: [step: number, run: number, length: number, offset: number][]): Buffer =>
      gzipSync(Buffer.from([...varint(rows.length), ...[0, 1, 2, 3].flatMap((k) => rows.flatMap((row) => varint(row[k] as number)))]));
    const rows = Array.from({ length: 13 }, (_, k): [number, number, number, number] => [
      k === 0 ? 5 : 1,
      k === 12 ? 4 : 1,
      3,
      k === 0 ? 1 : 0,
    ]);
    const leaf = directory(rows);
    const root = directory([[5, 0, leaf.length, 1]]);
    const tiles = Buffer.from(Array.from({ length: 13 }, (_, k) => [k, k, k]).flat());
    const header = Buffer.alloc(127);
    header.write("PMTiles");
    header[7] = 3;
    [127, root.length, 0, 0, 127 + root.length, leaf.length, 127 + root.length + leaf.length, tiles.length].forEach((value, k) =>
      header.writeBigUInt64LE(BigInt(value), 8 + 8 * k),
    );
    header.set([1, 2, 1, 2, 0, 2], 96);
    return new Uint8Array(Buffer.concat([header, root, leaf, tiles]));
  }

  test("every tile matches the reference reader", async () => {
    const bytes = archive();
    const part = (offset: number, length: number): Promise<ArrayBuffer> => Promise.resolve(bytes.slice(offset, offset + length).buffer);
    const mine = new Archive("x.pmtiles", () => part);
    const source: PmSource = { getKey: () => "x", getBytes: async (offset, length) => ({ data: await part(offset, length) }) };
    const theirs = new PMTiles(source);
    for (let y = 0; y < 4; y++) {
      for (let x = 0; x < 4; x++) {
        const want = (await theirs.getZxy(2, x, y))?.data;
        expect(want).toBeDefined();
        expect([...new Uint8Array((await mine.tile({ z: 2, x, y })) ?? new ArrayBuffer(0))]).toEqual([
          ...new Uint8Array(want ?? new ArrayBuffer(0)),
        ]);
      }
    }
    expect(await mine.tile({ z: 1, x: 0, y: 0 })).toBeNull();
    expect(await mine.tile({ z: 3, x: 0, y: 0 })).toBeNull();
  });

  test("a divided archive is read from its parts, by ranges that span several as well", async () => {
    const bytes = archive();
    const whole = new Archive("0-45/x.pmtiles", () => (offset, length) => Promise.resolve(bytes.slice(offset, offset + length).buffer));
    for (const size of [40, 127, bytes.length]) {
      const read = (name: string): ReadRange => {
        const part = Number(/^0-45\/x\.(\d+)\.pmtiles$/.exec(name)?.[1]);
        const file = bytes.slice(part * size, (part + 1) * size);
        return (offset, length) => Promise.resolve(file.slice(offset, offset + length).buffer);
      };
      const divided = new Archive("0-45/x.pmtiles", read, size);
      for (let x = 0; x < 4; x++) {
        const [got, want] = await Promise.all([divided, whole].map((each) => each.tile({ z: 2, x, y: 1 })));
        expect(new Uint8Array(got ?? new ArrayBuffer(0))).toEqual(new Uint8Array(want ?? new ArrayBuffer(1)));
      }
    }
  });

  test("a file that is not an archive is refused", async () => {
    await expect(new Archive("x.pmtiles", () => () => Promise.resolve(new ArrayBuffer(200))).tile({ z: 0, x: 0, y: 0 })).rejects.toThrow(
      /not a PMTiles/,
    );
  });
});

import { expect, test } from "vitest";
import type { Tile } from "../../src/geo/frame";
import type { FetchFunction, View } from "../../src/map3d";
import { decodeData } from "../../src/portrayal/decodeData";
import { makeViews } from "../../src/portrayal/grid";
import type { RequestedImage } from "../../src/portrayal/imageFormats";
import { readImageHeader } from "../../src/portrayal/imageHeader";
import { placeLayers } from "../../src/portrayal/layerPlace";
import { splitMultipart } from "../../src/portrayal/multipart";
import { ViewRequests } from "../../src/portrayal/viewRequests";
import { encodePng } from "../fixture/encodePng";
import { BOX, CAMERA, COLOR, NORMAL, TEMPLATE } from "../fixture/portrayalRequest";

const bytesOf = (text: string): ArrayBuffer => Uint8Array.from({ length: text.length }, (_, k) => text.charCodeAt(k)).buffer;

const LAYER = { identifier: "a", title: "", styles: [], queryable: false, renderings: [], lonLatBox: null };

test("the system of a layer: projected, with a box, axes by its code", () => {
  const boxes = [
    { crs: "EPSG:4326", low: [48, 11, 500], high: [48.1, 11.1, 600] },
    { crs: "EPSG:31467", low: [5_336_000, 3_500_000, 500], high: [5_336_100, 3_500_200, 600] },
  ];
  const layer = { ...LAYER, crs: ["EPSG:4326", "EPSG:25832", "urn:ogc:def:crs:EPSG::31467"], boxes };
  const expected = {
    crs: "urn:ogc:def:crs:EPSG::31467",
    epsg: 31467,
    northFirst: true,
    box: [
      [3_500_000, 5_336_000, 500],
      [3_500_200, 5_336_100, 600],
    ],
  };
  expect(placeLayers([layer], {}, "x")).toEqual(expected);
  expect(placeLayers([layer], { axes: "east-north" }, "x").box[0]).toEqual([5_336_000, 3_500_000, 500]);
  expect(placeLayers([layer], { crs: "EPSG:25832", box: BOX }, "x")).toEqual({
    crs: "EPSG:25832",
    epsg: 25832,
    northFirst: false,
    box: BOX,
  });
  expect(() => placeLayers([layer], { crs: "EPSG:2056" }, "x")).toThrow(/not available in EPSG:2056; it has EPSG:4326, EPSG:25832/);
  expect(() => placeLayers([{ ...layer, boxes: boxes.slice(0, 1) }], {}, "x")).toThrow(/no bounding box in a projected coordinate system/);
  expect(() => placeLayers([{ ...LAYER, crs: ["EPSG:25832"], boxes: [{ crs: "", low: [0, 0], high: [9, 9] }] }], {}, "x")).toThrow(
    /has no heights; give the option box/,
  );
  const degrees = { crs: "", low: [11, 48], high: [11.1, 48.1] };
  expect(() =>
    placeLayers([{ ...LAYER, crs: ["X:1"], lonLatBox: degrees, boxes: [{ crs: "", low: [11, 48, 0], high: [11.1, 48.1, 9] }] }], {}, "x"),
  ).toThrow(/no bounding box in a projected/);
});

const message = (parts: readonly [string, string][], boundary = "3DPS_MULTIPART_MESSAGE_BOUNDARY", end = "--\r\n"): ArrayBuffer =>
  bytesOf(
    `preamble\r\n${parts.map(([type, body]) => `--${boundary}\r\nContent-Type: ${type}\r\n\r\n${body}\r\n`).join("")}--${boundary}${end}`,
  );
const texts = (found: readonly { mediaType: string; bytes: ArrayBuffer }[] | null): unknown =>
  found?.map(({ mediaType, bytes }) => [mediaType, new TextDecoder("latin1").decode(bytes)]) ?? null;

test("parts of a multipart message are bytes as they were", () => {
  const parts: [string, string][] = [
    ["image/png;mode=32bit", "\r\n--x\x00\xff\r\n"],
    ["Image/JPEG", "--"],
  ];
  const expected = [
    ["image/png", "\r\n--x\x00\xff\r\n"],
    ["image/jpeg", "--"],
  ];
  expect(texts(splitMultipart(message(parts), "multipart/mixed"))).toEqual(expected);
  expect(texts(splitMultipart(message(parts, "a b"), 'multipart/mixed; charset=x; boundary="a b"'))).toEqual(expected);
  expect(
    texts(
      splitMultipart(bytesOf(new TextDecoder("latin1").decode(message([["image/png", "x"]])).replaceAll("\r\n", "\n")), "multipart/mixed"),
    ),
  ).toEqual([["image/png", "x"]]);
  for (const broken of [
    message(parts, "other"),
    message(parts, undefined, ""),
    bytesOf(""),
    bytesOf("--3DPS_MULTIPART_MESSAGE_BOUNDARY\r\n--3DPS_MULTIPART_MESSAGE_BOUNDARY--"),
  ])
    expect(splitMultipart(broken, "multipart/mixed")).toBeNull();
});

test("headers of images", () => {
  const png = encodePng(3, 5, 3, new Uint8Array(45));
  expect(readImageHeader(png)).toEqual({ mediaType: "image/png", width: 3, height: 5, complete: true });
  expect(readImageHeader(png.subarray(0, png.length - 1))?.complete).toBe(false);
  const jpeg = new Uint8Array(bytesOf("\xff\xd8\xff\xe0\x00\x04ab\xff\xff\xc2\x00\x0b\x08\x01\x00\x02\x00\x01\x00\x00\x00\xff\xd9\x00"));
  expect(readImageHeader(jpeg)).toEqual({ mediaType: "image/jpeg", width: 512, height: 256, complete: true });
  expect(readImageHeader(jpeg.subarray(0, jpeg.length - 3))?.complete).toBe(false);
  const riff = (chunk: string, rest: string): Uint8Array => new Uint8Array(bytesOf(`RIFF\x16\x00\x00\x00WEBP${chunk}${rest}`));
  expect(readImageHeader(riff("VP8 ", "\0\0\0\0\0\0\0\x9d\x01\x2a\x00\x01\x80\x00"))).toEqual({
    mediaType: "image/webp",
    width: 256,
    height: 128,
    complete: true,
  });
  expect(readImageHeader(riff("VP8L", "\0\0\0\0\x2f\xff\xc0\x1f\x00\0\0\0\0\0"))).toMatchObject({ width: 256, height: 128 });
  expect(readImageHeader(riff("VP8X", "\0\0\0\0\0\0\0\0\xff\0\0\x7f\0\0"))).toMatchObject({ width: 256, height: 128 });
  for (const other of ["", "GIF89a", "\xff\xd8\xff", "RIFF", "<html>"]) expect(readImageHeader(new Uint8Array(bytesOf(other)))).toBeNull();
});

test("data images: the standard's encodings become those of tiles", async () => {
  const decode = async (kind: "normal" | "id" | "depth", channels: 1 | 3 | 4, bytes: Uint8Array, rgbOrder = false): Promise<number[]> => {
    const data = await decodeData({ kind, bytes: encodePng(bytes.length / channels, 1, channels, bytes).buffer, rgbOrder, far_m: 5000 });
    return "values" in data ? [...data.values] : [];
  };
  expect(await decode("normal", 3, new Uint8Array([255, 128, 0, 0, 0, 0]))).toEqual([0, 128, 255, 0, 0, 0]);
  expect(await decode("normal", 4, new Uint8Array([255, 128, 0, 255, 9, 9, 9, 0]))).toEqual([0, 128, 255, 0, 0, 0]);
  expect(await decode("normal", 4, new Uint8Array([255, 128, 0, 255]), true)).toEqual([255, 128, 0]);
  expect(await decode("id", 3, new Uint8Array([1, 2, 3, 0, 0, 0]))).toEqual([0x030201, 0]);
  expect(await decode("id", 4, new Uint8Array([1, 2, 3, 0xff]))).toEqual([0xff030201]);
  const floats = new Float32Array([1, 1234.5, 0, -1, Infinity, NaN, 5000, 6000, 2 ** -10]);
  expect(await decode("depth", 4, new Uint8Array(floats.buffer))).toEqual([1024, 1234.5 * 1024, ...Array<number>(6).fill(0xffffffff), 1]);
  await expect(decode("depth", 3, new Uint8Array(3))).rejects.toThrow(/expected floats of 32 bits/);
  await expect(decode("id", 1, new Uint8Array(1))).rejects.toThrow(/expected 24 or 32 bits/);
});

const VIEW = makeViews(BOX, ["0-45"], 1, 256).views[0] as View;
const PNG = encodePng(256, 256, 4, new Uint8Array(4 * 65_536));
const PNG_TEXT = new TextDecoder("latin1").decode(PNG);

/** A service that answers several images as it likes. */
function service(together: (count: number) => Response, multipart?: boolean): { views: ViewRequests; asked: string[] } {
  const asked: string[] = [];
  const fetch: FetchFunction = (url) => {
    const images = /IMAGELAYERS=([A-Z,]+)/.exec(url)?.[1] ?? "";
    asked.push(images);
    const count = images.split(",").length;
    return Promise.resolve(count > 1 ? together(count) : new Response(PNG, { headers: { "Content-Type": "image/png" } }));
  };
  return { views: new ViewRequests(TEMPLATE, fetch, multipart), asked };
}
const ask = async (views: ViewRequests, tile: Tile, images: readonly RequestedImage[]): Promise<number[]> =>
  (await Promise.all(images.map((image) => views.request(VIEW, tile, CAMERA, image)))).map(({ byteLength }) => byteLength);
const packed = (count: number): Response =>
  new Response(message(Array.from({ length: count }, (): [string, string] => ["image/png", PNG_TEXT])), {
    headers: { "Content-Type": "multipart/mixed" },
  });
const T = { z: 0, x: 0, y: 0 };

test("images of a tile are one request", async () => {
  const { views, asked } = service(packed);
  expect(await ask(views, T, [COLOR, NORMAL, COLOR])).toEqual([PNG.length, PNG.length, PNG.length]);
  expect(await ask(views, { z: 1, x: 0, y: 0 }, [NORMAL])).toEqual([PNG.length]);
  expect(asked).toEqual(["COLOR,NORMAL", "NORMAL"]);
});

test.each<[string, () => Response]>([
  ["one image", () => new Response(PNG, { headers: { "Content-Type": "image/png" } })],
  ["an empty answer", () => new Response("", { headers: { "Content-Type": "multipart/mixed" } })],
  ["one part", () => packed(1)],
])("a service that answers several images with %s is asked for each image afterwards", async (_, together) => {
  const { views, asked } = service(together);
  expect(await ask(views, T, [COLOR, NORMAL])).toEqual([PNG.length, PNG.length]);
  expect(await ask(views, { z: 1, x: 1, y: 0 }, [COLOR, NORMAL])).toEqual([PNG.length, PNG.length]);
  expect(asked).toEqual(["COLOR,NORMAL", "COLOR", "NORMAL", "COLOR", "NORMAL"]);
});

test("an error page of a service that has sent several images once is an error", async () => {
  let count = 0;
  const { views } = service((images) =>
    count++ === 0 ? packed(images) : new Response("oh", { headers: { "Content-Type": "text/html" } }),
  );
  await ask(views, T, [COLOR, NORMAL]);
  await expect(ask(views, { z: 1, x: 0, y: 0 }, [COLOR, NORMAL])).rejects.toThrow(/expected 2 images as multipart\/mixed, got text\/html/);
});

test("a service that advertises single images is asked for them", async () => {
  const { views, asked } = service(packed, false);
  await ask(views, T, [COLOR, NORMAL]);
  expect(asked).toEqual(["COLOR", "NORMAL"]);
});

test("an aborted request ends with its reason; the request ends with the last one", async () => {
  const signals: AbortSignal[] = [];
  const views = new ViewRequests(
    TEMPLATE,
    (_, { signal }) =>
      new Promise((__, reject) => {
        signals.push(signal as AbortSignal);
        signal?.addEventListener("abort", () => {
          reject(signal.reason as Error);
        });
      }),
    undefined,
  );
  const [first, second] = [new AbortController(), new AbortController()];
  const asked = [views.request(VIEW, T, CAMERA, COLOR, first.signal), views.request(VIEW, T, CAMERA, NORMAL, second.signal)];
  const settled = Promise.allSettled(asked);
  await expect.poll(() => signals.length, { timeout: 20_000 }).toBe(1);
  first.abort(new Error("left"));
  expect(signals[0]?.aborted).toBe(false);
  second.abort(new Error("left too"));
  expect(signals[0]?.aborted).toBe(true);
  expect((await settled).map((one) => (one.status === "rejected" ? String(one.reason) : ""))).toEqual(["Error: left", "Error: left too"]);
});

test("a busy service is asked again after the time it names, at most four times", async () => {
  let count = 0;
  const busy = (times: number): ViewRequests =>
    new ViewRequests(
      TEMPLATE,
      () =>
        Promise.resolve(
          ++count <= times
            ? new Response("busy", { status: 503, headers: { "Retry-After": "0" } })
            : new Response(PNG, { headers: { "Content-Type": "image/png" } }),
        ),
      false,
    );
  expect((await busy(3).request(VIEW, T, CAMERA, COLOR)).byteLength).toBe(PNG.length);
  expect(count).toBe(4);
  count = 0;
  await expect(busy(9).request(VIEW, T, CAMERA, COLOR)).rejects.toMatchObject({ name: "FetchError", status: 503 });
  expect(count).toBe(4);
});

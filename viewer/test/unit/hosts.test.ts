import { describe, expect, test } from "vitest";
import { fetchBytes } from "../../src/tiles/fetch";

const URL_ = "https://host/town/0-45/color-00.pmtiles";
const answer = (status: number, headers: Record<string, string>): Response => new Response(new Uint8Array(8), { status, headers });
const read = (given: () => Promise<Response>): Promise<unknown> => fetchBytes([URL_], { range: [100, 8], attempts: 1, fetch: given });

describe("what a host does wrong with archives is named, and how to correct it", () => {
  test.each([
    ["ignores ranges", answer(200, {}), /ignores range requests \(HTTP 200.*nginx/],
    [
      "compresses parts",
      answer(206, { "content-encoding": "gzip" }),
      /compresses parts of files \(Content-Encoding: gzip\); switch compression off/,
    ],
    ["names a compression", answer(206, { "content-encoding": "br" }), /Content-Encoding: br/],
    [
      "sends its page for missing files",
      answer(200, { "content-type": "text/html; charset=utf-8" }),
      /sends a web page in place of this file/,
    ],
    ["has no file", answer(404, {}), /HTTP 404/],
  ])("a host that %s", async (_, response, message) => {
    await expect(read(() => Promise.resolve(response))).rejects.toThrow(message);
  });

  test("a host elsewhere that does not answer may lack CORS", async () => {
    await expect(read(() => Promise.reject(new TypeError("Failed to fetch")))).rejects.toThrow(
      /has to send the header Access-Control-Allow-Origin/,
    );
  });

  test("a good host is read", async () => {
    await expect(read(() => Promise.resolve(answer(206, { "content-encoding": "identity" })))).resolves.toHaveProperty("byteLength", 8);
  });
});

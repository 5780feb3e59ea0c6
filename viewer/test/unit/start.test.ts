import { readFileSync } from "node:fs";
import { join } from "node:path";
import { expect, test } from "vitest";

const read = (file: string): string => readFileSync(join(import.meta.dirname, "../..", file), "utf8");

/** Versions in the order Chrome, Firefox, Safari. */
const VERSION = /Chrome \S+ Edge (\d+), Firefox (\d+), Safari ([\d.]+\d)/g;

test("the page, in each language, and the README name the browsers that the build is made for", () => {
  const built = /"chrome(\d+)", "firefox(\d+)", "safari([\d.]+)"/.exec(read("scripts/build.mjs"))?.slice(1);
  for (const [file, count] of [
    ["page/start.js", 3],
    ["../README.md", 1],
  ] as const) {
    const named = [...read(file).matchAll(VERSION)].map((found) => found.slice(1));
    expect(named, file).toEqual(Array.from({ length: count }, () => built));
  }
});

import { readdirSync, readFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { createRequire } from "node:module";
import ts from "typescript";
import { expect, test } from "vitest";
import { INTERNAL_NAMES } from "../../scripts/internalNames.mjs";

const ROOT = resolve(import.meta.dirname, "../..");
const LIB = dirname(createRequire(import.meta.url).resolve("typescript"));

const read = (folder: string, end: string): string[] => readdirSync(folder, { recursive: true }).map(String).filter((name) => name.endsWith(end)).map((name) => readFileSync(join(folder, name), "utf8"));
const wordsOf = (texts: readonly string[]): Set<string> => new Set(texts.flatMap((text) => text.match(/\w+/g) ?? []));
const sources = read(join(ROOT, "src"), ".ts");

/** The words of all texts in the code; object keys that are written as texts are among them. */
function textsIn(source: string): string[] {
  const found: string[] = [];
  const visit = (node: ts.Node): void => {
    if (ts.isStringLiteralLike(node) || ts.isTemplateHead(node) || ts.isTemplateMiddle(node) || ts.isTemplateTail(node)) found.push(node.text);
    ts.forEachChild(node, visit);
  };
  visit(ts.createSourceFile("source.ts", source, ts.ScriptTarget.Latest));
  return found;
}

const OUTSIDE: [where: string, words: Set<string>][] = [
  ["a text of the code", wordsOf(sources.flatMap(textsIn))],
  ["the page", wordsOf(read(join(ROOT, "page"), ".ts"))],
  ["a test in a browser", wordsOf([...read(join(ROOT, "test/browser"), ".ts"), ...read(join(ROOT, "test/browsers"), ".ts")])],
  ["an example", wordsOf(read(join(ROOT, "examples"), ".html"))],
  ["the documentation", wordsOf([readFileSync(join(ROOT, "README.md"), "utf8"), ...read(join(ROOT, "../docs"), ".md")])],
  ["the manifest", wordsOf([readFileSync(join(ROOT, "../spec/manifest.schema.json"), "utf8")])],
  ["the DOM or the language", wordsOf(readdirSync(LIB).filter((name) => /^lib\..*d\.ts$/.test(name)).map((name) => readFileSync(join(LIB, name), "utf8")).map((text) => text.replace(/\/\*[^]*?\*\//g, "")))],
];

test.each(OUTSIDE)("no short name stands for a word of %s", (_, words) => {
  expect(words.size).toBeGreaterThan(20);
  expect(INTERNAL_NAMES.filter((name) => words.has(name))).toEqual([]);
});

test("each name occurs in the code, once in the list", () => {
  const words = wordsOf(sources);
  expect(INTERNAL_NAMES.filter((name) => !words.has(name))).toEqual([]);
  expect(new Set(INTERNAL_NAMES).size).toBe(INTERNAL_NAMES.length);
});

import { readdirSync, readFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { expect, test } from "vitest";
import { MAP_OPTIONS } from "../../src/map/options";

const SRC = resolve(import.meta.dirname, "../../src");
const README = readFileSync(join(SRC, "../README.md"), "utf8");
const FILES = readdirSync(SRC, { recursive: true, encoding: "utf8" }).filter((name) => name.endsWith(".ts"));

/** Lists the options that a file declares, in types or in tables, with their comments. */
function listOptions(text: string): { name: string; comment: string }[] {
  const types = [...text.matchAll(/^export interface (\w*Options)\b[^{]*\{\n(.*?)^\}/gms)];
  const tables = [...text.matchAll(/^(?:export )?const (\w*_OPTIONS) = \{\n(.*?)^\}/gms)];
  return [...types, ...tables].flatMap(([, type = "", body = ""]) =>
    [...body.matchAll(/(?:\/\*\*((?:(?!\*\/).)*)\*\/\s*)?^ {2}(?:readonly )?(\w+)(?:\?:|: option)/gms)].map(
      ([, comment = "", name = ""]) => ({
        name: `${type}.${name}`,
        comment,
      }),
    ),
  );
}

const OPTIONS = FILES.flatMap((file) => listOptions(readFileSync(join(SRC, file), "utf8")));

test("every option is documented beside its declaration, with its default", () => {
  expect(OPTIONS.length).toBeGreaterThan(90);
  expect(OPTIONS.filter(({ comment }) => !/default|@internal/i.test(comment)).map(({ name }) => name)).toEqual([]);
});

test("the README lists the options of the map", () => {
  const [, table = ""] = /^## `map`.*?^\| option \|.*?\n(.*?)\n\n/ms.exec(README) ?? [];
  const named = table.split("\n").flatMap((row) => [...(row.split("|")[1] ?? "").matchAll(/`(\w+)`/g)].map(([, name]) => name));
  expect(named.sort()).toEqual(
    Object.keys(MAP_OPTIONS)
      .filter((name) => name !== "finer")
      .sort(),
  );
});

test("the README repeats no defaults", () => {
  expect(README).not.toMatch(/^\| option \| default/m);
});

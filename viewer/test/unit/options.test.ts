import { readdirSync, readFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { expect, test } from "vitest";

const SRC = resolve(import.meta.dirname, "../../src");
const FILES = readdirSync(SRC, { recursive: true, encoding: "utf8" }).filter((name) => name.endsWith(".ts"));

/** Lists the optional fields of the option types of a file, with their comments. */
function listOptions(text: string): { name: string; comment: string }[] {
  const types = [...text.matchAll(/^export interface (\w*Options)\b[^{]*\{\n(.*?)^\}/gms)];
  return types.flatMap(([, type = "", body = ""]) =>
    [...body.matchAll(/(?:\/\*\*((?:(?!\*\/).)*)\*\/\s*)?^ {2}(?:readonly )?(\w+)\?:/gms)].map(([, comment = "", name = ""]) => ({
      name: `${type}.${name}`,
      comment,
    })),
  );
}

const OPTIONS = FILES.flatMap((file) => listOptions(readFileSync(join(SRC, file), "utf8")));

test("every option is documented beside its declaration, with its default", () => {
  expect(OPTIONS.length).toBeGreaterThan(90);
  expect(OPTIONS.filter(({ comment }) => !/default|@internal/i.test(comment)).map(({ name }) => name)).toEqual([]);
});

test("the README repeats no defaults", () => {
  const readme = readFileSync(join(SRC, "../README.md"), "utf8");
  expect(readme).not.toMatch(/^\| option \| default/m);
});

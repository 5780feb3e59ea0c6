import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { expect, test } from "vitest";
import { roofInWords } from "../../page/roofs";

const LIST = resolve(import.meta.dirname, "../../../crates/map3d-read/src/city_model/code_lists/sig3d_roof_type.txt");

test("every roof of the SIG3D list has a name in German and French", () => {
  const names = readFileSync(LIST, "utf8")
    .split("\n")
    .filter((line) => line && !line.startsWith("#"))
    .map((line) => line.split("\t")[1] ?? "");
  expect(names.length).toBeGreaterThan(10);
  for (const name of names) {
    expect(roofInWords(name, "en-GB")).toBe(name);
    for (const locale of ["de-AT", "fr"]) expect(roofInWords(name, locale)).not.toBe(name);
  }
});

test("other texts stay as they are", () => {
  for (const text of ["Satteldach", "", "toString"]) expect(roofInWords(text, "de")).toBe(text);
});

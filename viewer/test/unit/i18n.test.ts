import { readdirSync, readFileSync } from "node:fs";
import { resolve } from "node:path";
import { expect, test } from "vitest";
import { chooseLanguage, MESSAGE_KEYS } from "../../page/i18n";
import { getMapMessages } from "../../src/core/i18n";
import { describeDirection } from "../../src/compare/i18n";
import { computeWind } from "../../src/ui/controls";

test.each([
  [["de-CH", "en"], "de-CH"],
  [["it", "fr-FR", "en"], "fr-FR"],
  [["EN-us"], "EN-us"],
  [["ja", "zh"], "en"],
  [[], "en"],
])("for %j the page chooses %s", (requested, language) => {
  expect(chooseLanguage(requested)).toBe(language);
});

test("the page markup uses only known messages", () => {
  const html = readFileSync(resolve(import.meta.dirname, "../../page/index.html"), "utf8");
  const keys = [...html.matchAll(/data-i18n(?:-label|-placeholder)?="([^"]*)"/g)].map(([, key]) => key ?? "");
  expect(keys.length).toBeGreaterThan(10);
  expect(keys.filter((key) => !MESSAGE_KEYS.has(key))).toEqual([]);
});

test.each(["en", "de", "fr", "de-AT", "it", ""])("%s: every control has a name, every wind a different one", (language) => {
  const { facing, scale, winds, wheelWithKey, ...names } = getMapMessages(language);
  expect(Object.values(names).every((name) => name.trim() !== "")).toBe(true);
  expect(new Set(winds).size).toBe(8);
  for (const wind of winds) expect(facing(wind)).toContain(wind);
  expect(scale("20 m")).toContain("20 m");
  expect(wheelWithKey("⌘")).toContain("⌘");
});

test.each(["en", "de", "fr"])("%s: the captions of synchronized maps say what the compass says", (language) => {
  const { facing, winds } = getMapMessages(language);
  for (const deg of [0, 44, 45, 90, 200, 270, 350, -90, 720])
    expect(facing(winds[computeWind(deg)] ?? "").startsWith(describeDirection(deg, language))).toBe(true);
});

test("winds count counter-clockwise", () => {
  const { winds } = getMapMessages("en");
  expect([0, 45, 90, 179, 270, 340, -90, 720].map((deg) => winds[computeWind(deg)])).toEqual([
    "north",
    "north-west",
    "west",
    "south",
    "east",
    "north",
    "east",
    "north",
  ]);
});

/** All strings of the French tables of the viewer and the page, by file, without what is inserted into them. */
function frenchTexts(): [file: string, text: string][] {
  const root = resolve(import.meta.dirname, "../..");
  return ["src", "page"].flatMap((folder) =>
    readdirSync(resolve(root, folder), { recursive: true, encoding: "utf8" })
      .filter((name) => name.endsWith(".ts"))
      .flatMap((name) => {
        const code = readFileSync(resolve(root, folder, name), "utf8");
        const tables = [...code.matchAll(/^const FR\b[^]*?^\};|\bfr: .*/gm)].map(([table]) => table);
        return tables.flatMap((table) =>
          [...table.matchAll(/"([^"]*)"|`([^`]*)`/g)].map(([, quoted, template]): [string, string] => {
            const text = (quoted ?? template ?? "").replace(/\$\{[^}]*\}/g, "x");
            return [`${folder}/${name}`, text.replace(/\\u([0-9a-f]{4})/g, (_, code: string) => String.fromCharCode(parseInt(code, 16)))];
          }),
        );
      }),
  );
}

test("in French, a narrow no-break space is before ; ! ? and a no-break space before :, so that no line begins with them", () => {
  const texts = frenchTexts();
  expect(new Set(texts.map(([file]) => file)).size).toBeGreaterThanOrEqual(9);
  expect(texts.length).toBeGreaterThan(150);
  expect(texts.filter(([, text]) => /(?:^|[^\u202f])[;!?]|(?:^|[^\u00a0]):/.test(text))).toEqual([]);
  // What such a test finds.
  expect(texts.filter(([, text]) => /[;!?:]/.test(text)).length).toBeGreaterThanOrEqual(6);
});

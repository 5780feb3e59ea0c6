import { describe, expect, test } from "vitest";
import { classBounds, classify, HUES, RAMP, interpolateRamp, OTHER_COLOR, type ClassOptions } from "../../src/theme/classes";
import type { AttributeValue } from "../../src/map3d";

const OPTIONS: ClassOptions = { classes: 5, colors: undefined, language: "en", otherLabel: "Other" };
const column = (values: readonly AttributeValue[]): Map<number, AttributeValue> => new Map(values.map((value, k) => [k + 1, value]));
const upTo = (count: number, valueOf: (k: number) => AttributeValue): Map<number, AttributeValue> =>
  column(Array.from({ length: count }, (_, k) => valueOf(k)));

describe("numbers", () => {
  test("form classes of about equal counts with rounded bounds; every id is in one class", () => {
    const found = classify(
      { type: "number" },
      upTo(1000, (k) => 2 + 0.04 * k),
      OPTIONS,
    );
    expect(found.ordered).toBe(true);
    expect(found.classes.map(({ label }) => label)).toEqual(["< 10", "10–18", "18–26", "26–34", "≥ 34"]);
    expect(found.classes.map(({ ids }) => ids.length)).toEqual([200, 200, 200, 200, 200]);
    expect(found.classes.map(({ color }) => color)).toEqual([...RAMP]);
    expect(found.classes.flatMap(({ ids }) => ids).sort((a, b) => a - b)).toEqual(Array.from({ length: 1000 }, (_, k) => k + 1));
  });

  test("a value on a bound belongs to the class above", () => {
    const { classes } = classify(
      { type: "number" },
      upTo(40, (k) => k),
      OPTIONS,
    );
    for (const { label, ids } of classes) {
      const [, least = "0"] = /^(\d+)–|≥ (\d+)/.exec(label)?.filter(Boolean) ?? [];
      expect(Math.min(...ids) - 1).toBe(Number(least));
    }
  });

  test("years have no separators, large numbers do, small numbers keep their digits", () => {
    const labels = (values: (k: number) => number): string =>
      classify({ type: "number" }, upTo(100, values), OPTIONS)
        .classes.map(({ label }) => label)
        .join(" ");
    expect(labels((k) => 1900 + k)).toBe("< 1920 1920–1940 1940–1960 1960–1980 ≥ 1980");
    expect(labels((k) => 1000 * k)).toContain("20,000–40,000");
    expect(labels((k) => 0.001 * k)).toContain("0.02–0.04");
  });

  test("in text are ranges when there are many values, names when there are few", () => {
    expect(
      classify(
        { type: "text" },
        upTo(100, (k) => String(1900 + k)),
        OPTIONS,
      ).ordered,
    ).toBe(true);
    expect(
      classify(
        { type: "text" },
        upTo(100, (k) => String(1000 + (k % 4))),
        OPTIONS,
      ).ordered,
    ).toBe(false);
    expect(
      classify(
        { type: "mixed" },
        upTo(100, (k) => (k === 7 ? "unknown" : k)),
        OPTIONS,
      ).ordered,
    ).toBe(false);
    expect(
      classify(
        { type: "text" },
        upTo(100, (k) => (k === 7 ? " " : String(k))),
        OPTIONS,
      ).ordered,
    ).toBe(false);
  });

  test("with few values form one ordered class each", () => {
    const { classes, ordered } = classify({ type: "number" }, column([3, 1, 3, 2, 3]), OPTIONS);
    expect(ordered).toBe(true);
    expect(classes.map(({ label, ids }) => [label, ids])).toEqual([
      ["1", [2]],
      ["2", [4]],
      ["3", [1, 3, 5]],
    ]);
  });

  test.each([[[1, 1, 1, 1, 1, 1, 1, 9]], [[0, 0, 0, 0, 0, 0, 1e-9]], [[-5, -4, -3, -2, -1, 0, 1]], [[1e15, 2e15, 3e15, 4e15, 5e15, 6e15]]])(
    "bounds rise and leave no class empty: %j",
    (values) => {
      const bounds = classBounds(values, 5);
      expect([...new Set(bounds)].sort((a, b) => a - b)).toEqual(bounds);
      for (const bound of bounds) expect(values.some((value) => value < bound) && values.some((value) => value >= bound)).toBe(true);
    },
  );
});

describe("values", () => {
  test("get hues by frequency; the others form one class", () => {
    const { classes } = classify(
      { type: "text" },
      upTo(60, (k) => "abcdefghijk"[Math.floor(Math.sqrt(2 * k))] ?? "k"),
      OPTIONS,
    );
    expect(classes.length).toBe(HUES.length + 1);
    expect(classes.at(-1)).toMatchObject({ label: "Other", color: OTHER_COLOR });
    const counts = classes.slice(0, -1).map(({ ids }) => ids.length);
    expect(counts).toEqual([...counts].sort((a, b) => b - a));
    expect(classes.reduce((sum, { ids }) => sum + ids.length, 0)).toBe(60);
  });

  test("use the given colours", () => {
    const { classes } = classify({ type: "text" }, column(["x", "y", "z"]), { ...OPTIONS, colors: ["#111111", "#222222"] });
    expect(classes.map(({ label, color }) => [label, color])).toEqual([
      ["x", "#111111"],
      ["y", "#222222"],
      ["Other", OTHER_COLOR],
    ]);
  });

  test("an empty column has no classes", () => {
    expect(classify({ type: "text" }, new Map(), OPTIONS).classes).toEqual([]);
    expect(classify({ type: "number" }, new Map(), OPTIONS).classes).toEqual([]);
  });
});

test("ramps keep their ends and interpolate", () => {
  expect(interpolateRamp(["#000000", "#ffffff"], 3)).toEqual(["#000000", "#808080", "#ffffff"]);
  expect(interpolateRamp(RAMP, 1)).toEqual([RAMP[0]]);
  expect(interpolateRamp(RAMP, 5)).toEqual([...RAMP]);
});

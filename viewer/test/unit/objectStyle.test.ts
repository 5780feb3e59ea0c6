import { describe, expect, test } from "vitest";
import { packColor, packStyle } from "../../src/draw/drawStyle";
import { buildIdTable } from "../../src/draw/webgl/idTable";
import { makeDrawStyles, isHidden, type ObjectStyle } from "../../src/map/objectStyle";

const RED = [1, 0, 0];

describe("an object style", () => {
  const rows: [string, ObjectStyle, Record<number, unknown>, string][] = [
    ["colours alone leave the others as they are", { colors: new Map([[5, "#ff0000"]]) }, { 5: RED }, "plain"],
    ["only dims the others", { only: [5, 6] }, { 5: "plain", 6: "plain" }, "dimmed"],
    ["or hides them", { only: [5], others: "hidden" }, { 5: "plain" }, "hidden"],
    ["only none dims all", { only: [] }, {}, "dimmed"],
    [
      "colours hold for those that are shown",
      {
        colors: new Map([
          [5, "#ff0000"],
          [6, "#ff0000"],
        ]),
        only: [5],
      },
      { 5: RED },
      "dimmed",
    ],
    ["what is hidden is hidden", { colors: new Map([[5, "#ff0000"]]), only: [5], hidden: [5, 7] }, { 5: "hidden", 7: "hidden" }, "dimmed"],
    ["large ids are themselves", { hidden: [3_900_000_007] }, { 3_900_000_007: "hidden" }, "plain"],
  ];
  test.each(rows)("%s", (_, style, byId, others) => {
    const found = makeDrawStyles(style);
    expect(found?.others).toBe(others);
    expect(Object.fromEntries(found?.byId ?? [])).toEqual(byId);
  });

  const below = new Map([
    [5, [6, 7, 8]],
    [6, [8]],
    [9, []],
  ]);
  test.each([
    ["descendants have the style of the object above", { colors: new Map([[5, "#ff0000"]]) }, { 5: RED, 6: RED, 7: RED, 8: RED }],
    ["that of the nearest one", { colors: new Map([[5, "#ff0000"]]), hidden: [6] }, { 5: RED, 6: "hidden", 7: RED, 8: "hidden" }],
    ["or their own", { only: [5, 8], colors: new Map([[8, "#ff0000"]]) }, { 5: "plain", 6: "plain", 7: "plain", 8: RED }],
    ["or none, if the style says so", { hidden: [5], descendants: false }, { 5: "hidden" }],
  ])("%s", (_, style: ObjectStyle, byId) => {
    expect(Object.fromEntries(makeDrawStyles(style, below)?.byId ?? [])).toEqual(byId);
  });

  test("is null when it is empty", () => {
    expect(makeDrawStyles({})).toBe(null);
    expect(makeDrawStyles({ colors: new Map() })).toBe(null);
  });

  test("refuses an invalid colour", () => {
    expect(() => makeDrawStyles({ colors: new Map([[1, "url(x)"]]) })).toThrow(/url\(x\)/);
  });

  test("never hides the absence of an object", () => {
    const none = makeDrawStyles({ only: [5], others: "hidden" });
    expect([isHidden(none, 0), isHidden(none, 5), isHidden(none, 6), isHidden(null, 6)]).toEqual([false, false, true, false]);
  });
});

test("packed styles are distinct and never 0", () => {
  const words = (["plain", "dimmed", "hidden", [0, 0, 0], [1, 1, 1]] as const).map(packStyle);
  expect(new Set(words).size).toBe(5);
  expect(words.every((word) => word >>> 24 > 0 && word >>> 24 < 8)).toBe(true);
  expect(packStyle([1, 0, 0])).toBe(packColor([1, 0, 0]));
});

test("every id of a table is found within the longest search", () => {
  const ids = Array.from({ length: 5000 }, (_, k) => Math.imul(k + 1, 0x85ebca6b) >>> 0 || 1);
  const table = buildIdTable(new Map(ids.map((id, k) => [id, k + 1])), (word) => word);
  ids.forEach((id, k) => {
    let place = (Math.imul(id, 0x9e3779b9) >>> 7) & table.mask;
    let probe = 1;
    for (; table.slots[2 * place] !== id; probe++) place = (place + 1) & table.mask;
    expect(table.slots[2 * place + 1]).toBe(k + 1);
    expect(probe).toBeLessThanOrEqual(table.probes);
  });
});

import { describe, expect, test } from "vitest";
import type { ObjectInfo } from "../../src/map3d";
import { toCsv } from "../../src/filter/csv";
import { checkExpression, matches, type FilterExpression } from "../../src/filter/expression";

const HALL: Readonly<Record<string, string | number | boolean>> = {
  class: "building",
  height: 34,
  roof: "3100",
  storeys: "7",
  listed: true,
};
const holds = (expression: FilterExpression): boolean => matches(expression, (name) => HALL[name]);

describe("filter expressions", () => {
  test.each<[FilterExpression, boolean]>([
    [["==", "class", "building"], true],
    [["!=", "class", "building"], false],
    [["==", "listed", true], true],
    [["==", "height", 34], true],
    [["==", "roof", 3100], true],
    [["==", "roof", "3100"], true],
    [[">", "height", 20], true],
    [[">", "height", 34], false],
    [[">=", "height", 34], true],
    [["<", "storeys", 8], true],
    [["<", "storeys", 7], false],
    [["<=", "class", "car"], true],
    [[">", "class", 3], false],
    [["in", "class", "road", "building"], true],
    [["!in", "class", "road"], true],
    [["has", "height"], true],
    [["has", "year"], false],
    [["!has", "year"], true],
    [[">", "year", 1900], false],
    [["<", "year", 1900], false],
    [["!=", "year", 1900], true],
    [["==", "year", 1900], false],
    [["all", [">", "height", 20], ["==", "class", "building"]], true],
    [["any", [">", "height", 50], ["has", "roof"]], true],
    [["none", [">", "height", 50], ["has", "roof"]], false],
    [["all"], true],
    [["any"], false],
    [["all", ["any", ["<", "height", 3], ["none", ["has", "year"]]], ["has", "roof"]], true],
  ])("%j: %s", (expression, expected) => {
    checkExpression(expression);
    expect(holds(expression)).toBe(expected);
  });

  test("name their attributes", () => {
    expect([...checkExpression(["all", [">", "height", 20], ["any", ["has", "roof"], ["==", "height", 3]]])]).toEqual(["height", "roof"]);
  });

  test.each([
    [undefined],
    [">"],
    [[]],
    [["height", ">", 3]],
    [["=", "height", 3]],
    [[">", "height"]],
    [[">", "height", 3, 4]],
    [[">", "height", true]],
    [[">", 3, 3]],
    [["has"]],
    [["has", "height", 3]],
    [["all", "height"]],
    [["==", "height", null]],
    [["constructor", "x", 1]],
    [["all", [">", "height", [1]]]],
  ])("%j is refused with an example", (expression) => {
    expect(() => checkExpression(expression)).toThrow(/expected a filter such as \["all", \[">", "height", 20\].*with all, any, none, ==/);
  });
});

describe("CSV", () => {
  const object = (name: string, attributes: ObjectInfo["attributes"]): ObjectInfo => ({
    name,
    class: "building",
    parent: null,
    attributes,
  });

  test("has a row per object and a column per attribute; commas, quotation marks and line ends are quoted as in RFC 4180", () => {
    const text = toCsv([
      [17, object('The "Hall", old', { height: 34.5, note: "a\r\nb", listed: true })],
      [18, object("Tower", { height: null, name: "T" })],
    ]);
    expect(text).toBe(
      'id,name,class,height,listed,attribute:name,note\r\n17,"The ""Hall"", old",building,34.5,true,,"a\r\nb"\r\n18,Tower,building,,,T,\r\n',
    );
  });

  test.each([
    ["=1+1", "'=1+1"],
    ["+cmd|x", "'+cmd|x"],
    ["-2+3", "'-2+3"],
    ["@SUM(A1)", "'@SUM(A1)"],
    ["\t=1", "'\t=1"],
    ["\r=1", '"\'\r=1"'],
    ["\n=1", '"\'\n=1"'],
    ["＝1+1", "'＝1+1"],
    ['=HYPERLINK("x")', `"'=HYPERLINK(""x"")"`],
    ["a=b", "a=b"],
    ["'=1", "'=1"],
    ["-12.5", "-12.5"],
    ["+3", "+3"],
    [-12.5, "-12.5"],
    [true, "true"],
    ["", ""],
  ])("never starts a formula: %j is written as %j", (value, field) => {
    expect(toCsv([[1, object("T", { value })]])).toBe(`id,name,class,value\r\n1,T,building,${field}\r\n`);
  });

  test("never starts a formula in names and headers either", () => {
    expect(toCsv([[1, object("=N", { "@a": 1 })]])).toBe("id,name,class,'@a\r\n1,'=N,building,1\r\n");
  });

  test("of no object is the header", () => {
    expect(toCsv([])).toBe("id,name,class\r\n");
  });
});

import { describe as group, expect, test } from "vitest";
import { describe, nameOfResult, type Card } from "../../page/card";

const UNITS = { crs: "ETRS89 / UTM zone 32N", vertical: "DHHN2016" };
const card = (event: object): Card =>
  describe({ id: 7, position: [691032.126, 5336026, 562.5], approximate: false, ...event }, UNITS, [11.570123, 48.140456]);
const rows = (made: Card): Record<string, string> => Object.fromEntries(made.rows);

group("a card", () => {
  test.each([
    [
      "the name in the attributes",
      { name: "town7_b000086", class: "building", attributes: { name: "Werkhalle", address: "Apfelweg 1" } },
      "Werkhalle",
      "Building · Apfelweg 1",
    ],
    ["the object's own name", { name: "Town hall", class: "building", attributes: {} }, "Town hall", "Building"],
    [
      "the address instead of an id",
      { name: "DENW39AL1000ABCD", class: "building", attributes: { address: "Apfelweg 55, Lindenbrunn" } },
      "Apfelweg 55, Lindenbrunn",
      "Building",
    ],
    [
      "use and year without name and address",
      { name: "UUID_d281adfc-4901-0f52-540b-4cc1a9325f82", class: "building", attributes: { function: "house", yearOfConstruction: 1868 } },
      "house, 1868",
      "Building",
    ],
    [
      "the kind where nothing else is known",
      { name: "bldg_0001", class: "building_part", attributes: { function: "1000", yearOfConstruction: -9999 } },
      "Part of a building",
      "",
    ],
    ["the class of an extension in words", { name: "x_1", class: "flood_zone", attributes: {} }, "flood zone", ""],
    ["the number where the data says nothing", { name: "4711", class: "", attributes: {} }, "Object 7", ""],
  ])("has as its title %s, never a raw id", (_, event, title, note) => {
    expect([card(event).title, card(event).note]).toEqual([title, note]);
  });

  test("shows a measure with its unit, which is metres where the data says none", () => {
    const attributes = {
      measuredHeight: 30,
      "measuredHeight/unit": "ft",
      area: 80.5,
      "area/unit": "acre",
      "lost/unit": "kWh",
      name: "Inn",
      "name/unit": "x",
    };
    const made = card({ name: "b_1", class: "building", attributes });
    expect(rows(made)["Height"]).toBe("30 ft");
    const details = Object.fromEntries(made.details);
    expect(details).toMatchObject({ measuredHeight: "30 ft", area: "80.5 acre", "lost/unit": "kWh", name: "Inn" });
    expect(Object.keys(details)).not.toContain("area/unit");
  });

  test("says what people want to know in words, and keeps the rest as the data has it", () => {
    const made = card({
      name: "b_1",
      class: "building",
      attributes: {
        address: "Apfelweg 1",
        function: "1000",
        measuredHeight: 8.77,
        roofType: "gabled roof",
        storeysAboveGround: 2,
        yearOfConstruction: 1964,
        listed: true,
        architect: null,
        empty: "",
      },
    });
    expect(rows(made)).toEqual({
      Built: "1964",
      Height: "8.77 m",
      Storeys: "2",
      Roof: "gabled roof",
      Elevation: "562.50 m (DHHN2016)",
      Coordinates: "48.14046°, 11.57012°",
    });
    expect(made.details).toEqual([
      ["Position", "691032.13, 5336026.00"],
      ["id", "7"],
      ["gml:id", "b_1"],
      ["address", "Apfelweg 1"],
      ["function", "1000"],
      ["measuredHeight", "8.77"],
      ["roofType", "gabled roof"],
      ["storeysAboveGround", "2"],
      ["yearOfConstruction", "1964"],
      ["listed", "Yes"],
      ["architect", "–"],
    ]);
  });

  test("leaves out codes, and numbers that stand for nothing", () => {
    expect(rows(card({ class: "building", attributes: { roofType: "3100", measuredHeight: -9999, storeysAboveGround: "2" } }))).toEqual({
      Elevation: "562.50 m (DHHN2016)",
      Coordinates: "48.14046°, 11.57012°",
    });
  });

  test("of a point on nothing has its place alone", () => {
    const made = card({ id: 0, approximate: true });
    expect([made.title, made.note]).toEqual(["Point", "approximate"]);
    expect(rows(made)).toEqual({
      Elevation: "562.50 m (DHHN2016)",
      Coordinates: "48.14046°, 11.57012°",
      Position: "691032.13, 5336026.00",
    });
    expect(made.details).toEqual([]);
  });

  test("of the ground says where the spot is, without unfolding anything", () => {
    expect(card({ id: 3, name: "terrain-2-1", class: "terrain" }).title).toBe("Ground");
    expect(rows(card({ id: 3, class: "terrain" }))).toEqual({
      Elevation: "562.50 m (DHHN2016)",
      Coordinates: "48.14046°, 11.57012°",
      Position: "691032.13, 5336026.00",
    });
  });

  test("without a position has no coordinates", () => {
    expect(describe({ id: 7, class: "building", position: null, approximate: false }, UNITS, null).rows).toEqual([]);
  });
});

test.each([
  ["Town hall, Marktplatz 1", "Town hall, Marktplatz 1"],
  ["Marktplatz 1", "Marktplatz 1"],
  ["building", "Building"],
  ["flood_zone", "flood zone"],
  ["DEBY_LOD2_4959323, Marktplatz 1", "Marktplatz 1"],
  ["DEBY_LOD2_4959323", "Object"],
])("the search result %s is called %s", (label, name) => {
  expect(nameOfResult(label)).toBe(name);
});

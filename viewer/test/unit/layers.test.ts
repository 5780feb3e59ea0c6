import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { expect, test } from "vitest";
import { DATA_KINDS, LIGHT_KINDS } from "../../src/geo/manifest";
import { CHANNELS } from "../../src/tiles/tileData";

interface Row {
  kind: string;
  array: { pixel: keyof typeof BYTES } | null;
  traced: boolean;
  unit_m: number | null;
  holds: string[];
}

const rows = JSON.parse(readFileSync(resolve(import.meta.dirname, "../../../spec/layers.json"), "utf8")) as Row[];
/** Bytes per pixel in a PNG, by the type of the array's pixels; 0 for pictures. */
const BYTES = { uint8: 1, uint16: 2, uint32: 4, int16x3: 3, uint16x4: 0 };

test("the viewer knows the kinds of layers that the specification lists", () => {
  const expected = rows.flatMap(({ kind, array }) => (array ? [[kind, BYTES[array.pixel]] as const] : []));
  expect(CHANNELS).toEqual(Object.fromEntries(expected));
});

test("a data tile holds the kinds that the specification says", () => {
  expect(DATA_KINDS).toEqual(rows.find(({ kind }) => kind === "data")?.holds);
});

test("rendered light is what rays compute, but for pictures and lengths", () => {
  const light = rows.filter(({ array, traced, unit_m }) => traced && array?.pixel !== "uint16x4" && unit_m === null);
  expect(LIGHT_KINDS).toEqual(light.map(({ kind }) => kind));
});

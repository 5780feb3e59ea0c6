import type { LayerInfo, SunJson } from "./manifest";

/** Sine of the sun's elevation in a first picture: shadows are long there, but streets are not dark. */
const HEIGHT = 0.5;

/** Finds the rendered sun for a first picture: that of a single sun, else the first of the day that is 30° high, else the highest; undefined without suns. */
export function findFirstSun(layers: readonly LayerInfo[]): SunJson | undefined {
  const suns = [...layers].sort((a, b) => Number(b.kind === "sun") - Number(a.kind === "sun")).flatMap(({ suns }) => suns ?? []);
  return suns.find(({ direction }) => direction[2] >= HEIGHT) ?? [...suns].sort((a, b) => b.direction[2] - a.direction[2])[0];
}

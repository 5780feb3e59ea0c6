import { UsageError } from "../map3d";

/** How a feature is drawn; lengths in CSS pixels, colours any of CSS. */
export interface FeatureStyle {
  /** Of lines, outlines and dots. Default the map's accent. */
  color?: string;
  /** Of lines. Default 3; 0: none. */
  width?: number;
  /** 0..1. Default 1. */
  opacity?: number;
  /** Lengths of dashes and gaps. Default none. */
  dash?: readonly number[];
  /** Around lines, so that they stand out; null: none. Default a white veil. */
  halo?: string | null;
  /** Of polygons; null: none. Default `color`. */
  fill?: string | null;
  /** 0..1. Default 0.25. */
  fillOpacity?: number;
  /** Of dots. Default 6. */
  radius?: number;
}

export interface FilledStyle extends Required<Omit<FeatureStyle, "fill">> {
  /** Red, green, blue 0..255, opacity 0..1. */
  readonly fill: readonly [number, number, number, number] | null;
}

/** @throws UsageError for numbers and colours that are none */
export function filledStyle(style: FeatureStyle, accent: string): FilledStyle {
  const { color = accent, width = 3, opacity = 1, dash = [], halo = "rgba(255, 255, 255, 0.75)", fill = color, fillOpacity = 0.25, radius = 6 } = style;
  const numbers: [string, number][] = [["width", width], ["opacity", opacity], ["fillOpacity", fillOpacity], ["radius", radius], ...dash.map((length): [string, number] => ["dash", length])];
  for (const [name, value] of numbers) if (!(Number.isFinite(value) && value >= 0)) throw new UsageError(`a feature's ${name} is a number, 0 or more, got ${String(value).slice(0, 40)}`);
  if (halo !== null) rgbaOf(halo);
  const [r, g, b, a] = rgbaOf(fill ?? "#000");
  return { color: colorOf(rgbaOf(color)), width, opacity: Math.min(opacity, 1), dash, halo, fill: fill === null || fillOpacity === 0 ? null : [r, g, b, a * Math.min(fillOpacity, 1)], fillOpacity, radius };
}

const colorOf = ([r, g, b, a]: readonly number[]): string => `rgba(${String(r)}, ${String(g)}, ${String(b)}, ${String(a)})`;

type Rgba = [number, number, number, number];
const read = new Map<string, Rgba>();
let context: CanvasRenderingContext2D | null | undefined;

/** What a CSS colour is in numbers, as a canvas understands it. @throws UsageError */
export function rgbaOf(color: string): Rgba {
  const known = read.get(color);
  if (known) return known;
  const parsed = parsedOf(color) ?? parsedOf(normal(color));
  if (!parsed) throw new UsageError(`a feature's colour is one of CSS in sRGB, got "${color.slice(0, 40)}"`);
  if (read.size < 4096) read.set(color, parsed);
  return parsed;
}

/** #rrggbb or rgba(…); the empty string for what is no colour, which leaves a canvas's colour as it was. */
function normal(color: string): string {
  context ??= document.createElement("canvas").getContext("2d");
  const [onBlack, onWhite] = ["#000000", "#ffffff"].map((before) => {
    if (context) context.fillStyle = before;
    if (context) context.fillStyle = color;
    return context?.fillStyle as string;
  });
  return onBlack === onWhite ? (onBlack ?? "") : "";
}

function parsedOf(color: string): Rgba | null {
  if (/^#[\da-f]{6}$/i.test(color)) return [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16)).concat(1) as Rgba;
  const [r, g, b, a = 1] = /^rgba?\(([^)]*)\)$/.exec(color)?.[1]?.split(/[\s,/]+/).map(Number) ?? [];
  return r !== undefined && g !== undefined && b !== undefined && [r, g, b, a].every(Number.isFinite) ? [r, g, b, a] : null;
}

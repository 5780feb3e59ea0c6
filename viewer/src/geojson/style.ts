import { UsageError } from "../map3d";

/** Style of a feature. Lengths are CSS pixels, colours any CSS colour. */
export interface FeatureStyle {
  /** Colour of lines, outlines and dots. Default: the map's accent colour. */
  color?: string;
  /** Line width; 0 for none. Default 3. */
  width?: number;
  /** Opacity, 0 to 1. Default 1. */
  opacity?: number;
  /** Lengths of dashes and gaps. Default: solid. */
  dash?: readonly number[];
  /** Outline colour of lines, for contrast; null for none. Default: translucent white. */
  halo?: string | null;
  /** Fill colour of polygons; null for none. Default: `color`. */
  fill?: string | null;
  /** Fill opacity, 0 to 1. Default 0.25. */
  fillOpacity?: number;
  /** Radius of dots. Default 6. */
  radius?: number;
}

export interface ResolvedStyle extends Required<Omit<FeatureStyle, "fill">> {
  /** Red, green, blue (0 to 255) and opacity (0 to 1). */
  readonly fill: readonly [number, number, number, number] | null;
}

/** Fills in the defaults and parses the colours. @throws UsageError for invalid numbers and colours */
export function resolveStyle(style: FeatureStyle, accent: string): ResolvedStyle {
  const {
    color = accent,
    width = 3,
    opacity = 1,
    dash = [],
    halo = "rgba(255, 255, 255, 0.75)",
    fill = color,
    fillOpacity = 0.25,
    radius = 6,
  } = style;
  const numbers: [string, number][] = [
    ["width", width],
    ["opacity", opacity],
    ["fillOpacity", fillOpacity],
    ["radius", radius],
    ...dash.map((length): [string, number] => ["dash", length]),
  ];
  for (const [name, value] of numbers)
    if (!(Number.isFinite(value) && value >= 0))
      throw new UsageError(`a feature's ${name} must be a number of at least 0, got ${String(value).slice(0, 40)}`);
  if (halo !== null) rgbaOf(halo);
  const [r, g, b, a] = rgbaOf(fill ?? "#000");
  return {
    color: colorOf(rgbaOf(color)),
    width,
    opacity: Math.min(opacity, 1),
    dash,
    halo,
    fill: fill === null || fillOpacity === 0 ? null : [r, g, b, a * Math.min(fillOpacity, 1)],
    fillOpacity,
    radius,
  };
}

const colorOf = ([r, g, b, a]: readonly number[]): string => `rgba(${String(r)}, ${String(g)}, ${String(b)}, ${String(a)})`;

type Rgba = [number, number, number, number];
const cache = new Map<string, Rgba>();
let context: CanvasRenderingContext2D | null | undefined;

/** Parses a CSS colour, with the help of a 2D canvas. @throws UsageError */
export function rgbaOf(color: string): Rgba {
  const known = cache.get(color);
  if (known) return known;
  const parsed = parseColor(color) ?? parseColor(normalizeColor(color));
  if (!parsed) throw new UsageError(`a feature's colour must be a CSS colour in sRGB, got "${color.slice(0, 40)}"`);
  if (cache.size < 4096) cache.set(color, parsed);
  return parsed;
}

/** Returns #rrggbb or rgba(…); "" for an invalid colour, which leaves the canvas's fill style unchanged. */
function normalizeColor(color: string): string {
  context ??= document.createElement("canvas").getContext("2d");
  const [onBlack, onWhite] = ["#000000", "#ffffff"].map((before) => {
    if (context) context.fillStyle = before;
    if (context) context.fillStyle = color;
    return context?.fillStyle as string;
  });
  return onBlack === onWhite ? (onBlack ?? "") : "";
}

function parseColor(color: string): Rgba | null {
  if (/^#[\da-f]{6}$/i.test(color)) return [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16)).concat(1) as Rgba;
  const [r, g, b, a = 1] =
    /^rgba?\(([^)]*)\)$/
      .exec(color)?.[1]
      ?.split(/[\s,/]+/)
      .map(Number) ?? [];
  return r !== undefined && g !== undefined && b !== undefined && [r, g, b, a].every(Number.isFinite) ? [r, g, b, a] : null;
}

import { UsageError } from "../core/errors";

/** sRGB, 0..1 each. */
export type Rgb = readonly [number, number, number];

/** Parses `#rgb`, `#rrggbb` or `rgb(r g b)`. @throws UsageError */
export function parseColor(text: string): Rgb {
  const hex = /^#([0-9a-f]{3}|[0-9a-f]{6})$/i.exec(text.trim())?.[1];
  if (hex) {
    const long = hex.length === 3 ? hex.replace(/./g, "$&$&") : hex;
    return [0, 2, 4].map((at) => parseInt(long.slice(at, at + 2), 16) / 255) as unknown as Rgb;
  }
  const numbers = /^rgb\(\s*(\d+)[\s,]+(\d+)[\s,]+(\d+)\s*\)$/i.exec(text.trim());
  if (!numbers) throw new UsageError(`invalid colour "${text}"; use #rrggbb or rgb(r g b)`);
  return numbers.slice(1, 4).map((part) => Math.min(Number(part), 255) / 255) as unknown as Rgb;
}

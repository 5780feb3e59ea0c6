import { parseColor, type Rgb } from "../draw/color";
import type { DrawStyle, DrawStyles } from "../draw/drawStyle";

/** How a layer's objects are shown. What is not said stays as it is. */
export interface ObjectStyle {
  /** Colours (#rrggbb) by id; light falls on them. */
  colors?: ReadonlyMap<number, string>;
  /** Only these are shown as they are, or in their colours; see `others`. */
  only?: Iterable<number>;
  /** What becomes of the objects that are not in `only`. Default "dimmed". */
  others?: "dimmed" | "hidden";
  /** These are not shown, and cannot be picked. */
  hidden?: Iterable<number>;
}

/** null: all as they are. */
export function makeDrawStyles({ colors, only, others = "dimmed", hidden }: ObjectStyle): DrawStyles | null {
  const read = new Map<string, Rgb>();
  const rgbOf = (color: string): Rgb => {
    const rgb = read.get(color) ?? parseColor(color);
    read.set(color, rgb);
    return rgb;
  };
  const byId = new Map<number, DrawStyle>();
  for (const id of only ?? []) byId.set(id >>> 0, "plain");
  for (const [id, color] of colors ?? []) if (!only || byId.has(id >>> 0)) byId.set(id >>> 0, rgbOf(color));
  for (const id of hidden ?? []) byId.set(id >>> 0, "hidden");
  return only || byId.size > 0 ? { byId, others: only ? others : "plain" } : null;
}

export const isHidden = (finishes: DrawStyles | null, id: number): boolean => finishes !== null && id !== 0 && (finishes.byId.get(id) ?? finishes.others) === "hidden";

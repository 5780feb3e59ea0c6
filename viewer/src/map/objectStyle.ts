import { parseColor, type Rgb } from "../draw/color";
import type { DrawStyle, DrawStyles } from "../draw/drawStyle";

/** Styles of a layer's objects. Objects that are not mentioned stay plain. */
export interface ObjectStyle {
  /** Tints (#rrggbb) by object id; they are lit. */
  colors?: ReadonlyMap<number, string>;
  /** Only these objects are plain or tinted; see `others`. */
  only?: Iterable<number>;
  /** Style of the objects that are not in `only`. Default "dimmed". */
  others?: "dimmed" | "hidden";
  /** Objects that are not drawn and cannot be picked. */
  hidden?: Iterable<number>;
}

/** Converts a style; null: all objects are plain. */
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

export const isHidden = (styles: DrawStyles | null, id: number): boolean => styles !== null && id !== 0 && (styles.byId.get(id) ?? styles.others) === "hidden";

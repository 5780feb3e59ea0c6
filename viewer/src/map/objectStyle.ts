import { parseColor, type Rgb } from "../draw/color";
import type { DrawStyle, DrawStyles } from "../draw/drawStyle";

/** Styles of a layer's objects and of their descendants, such as a building's parts. Objects that are not mentioned stay plain. */
export interface ObjectStyle {
  /** Tints (#rrggbb) by object id; they are lit. */
  colors?: ReadonlyMap<number, string>;
  /** Only these objects are plain or tinted; see `others`. */
  only?: Iterable<number>;
  /** Style of the objects that are not in `only`. Default "dimmed". */
  others?: "dimmed" | "hidden";
  /** Objects that are not drawn and cannot be picked. */
  hidden?: Iterable<number>;
  /** false: descendants have no style unless they are mentioned; then no attributes are fetched. Default true. */
  descendants?: boolean;
}

/** Lists the objects whose descendants a style includes. */
export const listStyledIds = ({ colors, only, hidden, descendants = true }: ObjectStyle): number[] =>
  descendants ? [...(colors?.keys() ?? []), ...(only ?? []), ...(hidden ?? [])] : [];

/** Converts a style; null: all objects are plain. @param below known descendants, which have the style of the nearest mentioned object */
export function makeDrawStyles(
  { colors, only, others = "dimmed", hidden, descendants = true }: ObjectStyle,
  below: Descendants = new Map(),
): DrawStyles | null {
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
  if (descendants) inherit(byId, below);
  return only || byId.size > 0 ? { byId, others: only ? others : "plain" } : null;
}

/** Descendants by id. */
export type Descendants = ReadonlyMap<number, readonly number[]>;

/** Gives descendants without a value that of the nearest object above them that has one: the one with the fewest descendants. */
export function inherit<T>(values: Map<number, T>, below: Descendants): void {
  const count = (id: number): number => below.get(id)?.length ?? 0;
  const above = [...values].filter(([id]) => count(id) > 0).sort(([a], [b]) => count(a) - count(b));
  for (const [id, value] of above) for (const part of below.get(id) ?? []) if (!values.has(part)) values.set(part, value);
}

export const isHidden = (styles: DrawStyles | null, id: number): boolean =>
  styles !== null && id !== 0 && (styles.byId.get(id) ?? styles.others) === "hidden";

import type { Vec3 } from "../core/vec";

/** A name and its place. */
export interface Label {
  readonly text: string;
  /** Where it can stand, the best place first. World coordinates; without a height (NaN) on the visible surface. */
  readonly positions: readonly [Vec3, ...Vec3[]];
  /** Labels with a higher rank come first where there is no room for all. */
  readonly rank: number;
  /** Whether it names a line, such as a street. */
  readonly line: boolean;
}

/** One word with three digits in a row, or with an underscore: an identifier of the data. */
const IDENTIFIER = /^\S*(\d{3}|_)\S*$/;

/** Returns a name that people use; "" for an identifier of the data, or anything but text. */
export function properName(value: unknown): string {
  const text = typeof value === "string" ? value.trim() : "";
  return IDENTIFIER.test(text) ? "" : text;
}

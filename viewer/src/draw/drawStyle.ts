import type { Rgb } from "./drawer";

/** How an object is shown: in a colour that light falls on, as it is, pale, or not at all. */
export type DrawStyle = Rgb | "plain" | "dimmed" | "hidden";

/** Of a layer's objects, by id. */
export interface DrawStyles {
  readonly byId: ReadonlyMap<number, DrawStyle>;
  readonly others: Exclude<DrawStyle, Rgb>;
}

/** Of the colour; the rest is the object's own, so that windows can still be seen. */
export const PAINT = 0.85;
/** What is dimmed becomes this grey by the second share, after it has lost its colour. */
export const PALE = [0.86, 0.65] as const;

const KINDS = { plain: 2, dimmed: 3, hidden: 4 } as const;

/** R in the low byte; bits 24 to 26 tell colours (1) from what is plain, dimmed and hidden. Never 0. */
export const packFinish = (finish: DrawStyle): number => (typeof finish === "string" ? KINDS[finish] << 24 : packColor(finish));

/** R in the low byte; bit 24 set. */
export const packColor = (color: Rgb): number => color.reduce((sum, part, k) => sum + (Math.round(part * 255) << (8 * k)), 1 << 24);

import type { Rgb } from "./color";

/** How an object is shown: in a colour that light falls on, as it is, pale, or not at all. */
export type DrawStyle = Rgb | "plain" | "dimmed" | "hidden";

/** Of a layer's objects, by id. */
export interface DrawStyles {
  readonly byId: ReadonlyMap<number, DrawStyle>;
  readonly others: Exclude<DrawStyle, Rgb>;
}

/** Of the colour; the rest is the object's own, so that windows can still be seen. */
export const TINT_OPACITY = 0.85;
/** What is dimmed becomes this grey by the second share, after it has lost its colour. */
export const DIM_GREY = [0.86, 0.65] as const;

const STYLE_CODES = { plain: 2, dimmed: 3, hidden: 4 } as const;

/** R in the low byte; bits 24 to 26 tell colours (1) from what is plain, dimmed and hidden. Never 0. */
export const packStyle = (finish: DrawStyle): number => (typeof finish === "string" ? STYLE_CODES[finish] << 24 : packColor(finish));

/** R in the low byte; bit 24 set. */
export const packColor = (color: Rgb): number => color.reduce((sum, part, k) => sum + (Math.round(part * 255) << (8 * k)), 1 << 24);

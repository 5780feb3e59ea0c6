import type { Rgb } from "./color";

/** An object's style: a tint (lit), plain, pale, or not drawn. */
export type DrawStyle = Rgb | "plain" | "dimmed" | "hidden";

/** The draw styles of a layer's objects. */
export interface DrawStyles {
  readonly byId: ReadonlyMap<number, DrawStyle>;
  readonly others: Exclude<DrawStyle, Rgb>;
}

/** Opacity of a tint; the rest is the object's own colour, so that windows stay visible. */
export const TINT_OPACITY = 0.85;
/** Dimmed objects lose their colour and are mixed with this grey (first value) by this weight (second value). */
export const DIM_GREY = [0.86, 0.65] as const;

const STYLE_CODES = { plain: 2, dimmed: 3, hidden: 4 } as const;

/** Packs a style: R in the low byte; bits 24 to 26 distinguish colours (1) from plain, dimmed and hidden. Never 0. */
export const packStyle = (style: DrawStyle): number => (typeof style === "string" ? STYLE_CODES[style] << 24 : packColor(style));

/** Packs a colour: R in the low byte, bit 24 set. */
export const packColor = (color: Rgb): number => color.reduce((sum, part, k) => sum + (Math.round(part * 255) << (8 * k)), 1 << 24);

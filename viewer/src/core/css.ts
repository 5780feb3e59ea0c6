/** Marks a style sheet in a template string; the build writes it in short. */
export const css = String.raw;

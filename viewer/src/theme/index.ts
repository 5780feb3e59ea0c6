/** map3d-theme: colours objects by an attribute, with a legend. */
export { theme, theme as Theme, type ThemeEvents, type ThemeOptions } from "./theme";
export type { ThemeClass } from "./classes";

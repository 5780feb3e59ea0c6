/** map3d-theme: colours objects by an attribute, with a legend. */
export { Theme, Theme as theme, type ThemeEvents, type ThemeOptions } from "./theme";
export type { ThemeClass } from "./classes";

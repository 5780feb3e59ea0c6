/** map3d-theme: objects in colours by an attribute, with a legend. */
export { theme, type ThemeEvents, type ThemeOptions } from "./theme";
export type { ThemeClass } from "./classes";

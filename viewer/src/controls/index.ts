/** map3d-controls: shows the user's location and an overview map. */
export { locate, type Located, type LocateEvents, type LocateOptions } from "./locate";
export { overview, type OverviewOptions } from "./overview";

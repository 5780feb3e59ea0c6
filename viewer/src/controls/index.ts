/** map3d-controls: where the reader is, and an overview of the whole. */
export { locate, type Located, type LocateEvents, type LocateOptions } from "./locate";
export { overview, type OverviewOptions } from "./overview";

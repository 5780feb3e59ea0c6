/** map3d-geojson: features on the surface or at heights of their own. */
export { geojson, type FeatureEvent, type GeojsonEvents, type GeojsonOptions } from "./geojson";
export type { Feature, Skipped } from "./parse";
export type { Occlusion } from "./placed";
export type { FeatureStyle } from "./style";

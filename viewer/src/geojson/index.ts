/** map3d-geojson: shows GeoJSON features, draped on the surface or at their own heights. */
export { GeoJSON, GeoJSON as geojson, type FeatureEvent, type GeojsonEvents, type GeojsonOptions } from "./geojson";
export type { Feature, Skipped } from "./parse";
export type { Occlusion } from "./placedFeature";
export type { FeatureStyle } from "./style";

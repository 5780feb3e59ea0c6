/** map3d-labels: names of streets, squares and buildings on the map. */
export { labels, labels as Labels, type LabelsEvents, type LabelsOptions } from "./labels";
export type { LabelledFeature } from "./fromGeoJson";

/** map3d-labels: names of streets, squares and buildings on the map. */
export { Labels, Labels as labels, type LabelsEvents, type LabelsOptions } from "./labels";
export type { LabelledFeature } from "./fromGeoJson";

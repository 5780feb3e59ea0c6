/** map3d-measure: measures lengths, heights, areas, faces and profiles on the surface. */
export { Measure, Measure as measure, type MeasureCorner, type MeasureEvents, type MeasureOptions } from "./measure";
export { measureProfile, type Profile, type ProfileOptions } from "./profile";
export { measureFace, type Face, type FaceOptions } from "./face";
export { measureArea, measureLine, type AreaMeasure, type LineMeasure } from "./geometry";

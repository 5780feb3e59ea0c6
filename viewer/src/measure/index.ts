/** map3d-measure: lengths, heights and areas on the surface. */
export { measure, type Corner, type MeasureEvents, type MeasureOptions } from "./measure";
export { measureArea, measureLine, type AreaMeasure, type LineMeasure } from "./geometry";

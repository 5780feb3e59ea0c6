/** map3d-offline: areas of a map that are kept in the browser. map3d-worker.js answers from them when the network does not. */
export { downloadArea, estimateArea, type AreaEstimate, type AreaProgress, type DownloadOptions } from "./download";
export { listAreas, removeArea, type StoredArea } from "./areas";
export { canKeep, registerWorker } from "./register";
export { StorageError } from "./keeper";
export type { AreaOptions, FilledArea } from "./plan";

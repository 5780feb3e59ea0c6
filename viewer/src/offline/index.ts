/** map3d-offline: saves areas of a map in the browser. The service worker map3d-worker.js serves them when the network is unavailable. */
export { downloadArea, estimateArea, type AreaEstimate, type AreaProgress, type DownloadOptions } from "./download";
export { listAreas, removeArea, type StoredArea } from "./areas";
export { isOfflineAvailable, registerWorker } from "./register";
export { StorageError } from "./offlineCache";
export type { AreaOptions, FilledArea } from "./areaPlan";

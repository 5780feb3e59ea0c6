/** map3d-files: shows renderings from the user's own files, chosen or dropped on the map. */
export { filesSource, FilesError } from "./filesSource";
export type { FilesProblem } from "./i18n";
export { DropFiles, DropFiles as dropFiles, type DropEvents, type DropOptions } from "./dropFiles";
export type { Folder } from "./folder";

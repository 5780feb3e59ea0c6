/** map3d-files: renderings from files of the reader's own, chosen or dropped on the map. */
export { filesSource, FilesError } from "./filesSource";
export type { FilesProblem } from "./i18n";
export { dropFiles, type DropEvents, type DropOptions } from "./dropFiles";
export type { Folder } from "./folder";

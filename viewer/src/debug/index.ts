/** map3d-debug: shows the tiles of a map, for developers. */
export { debugTiles, debugTiles as DebugTiles } from "./debugTiles";

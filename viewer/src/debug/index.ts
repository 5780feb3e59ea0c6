/** map3d-debug: shows the tiles of a map, for developers. */
export { DebugTiles, DebugTiles as debugTiles } from "./debugTiles";

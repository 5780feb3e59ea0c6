/** map3d-controls: controls in the corners of the map, the user's location and an overview map. */
import { features } from "../map3d";
import { addToCorner } from "./corners";

features["controls"] = addToCorner;
export { control, control as Control, type ControlOptions } from "./corners";
export { locate, locate as Locate, type Located, type LocateEvents, type LocateOptions } from "./locate";
export { overview, overview as Overview, type OverviewOptions } from "./overview";

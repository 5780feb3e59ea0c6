/** map3d-controls: controls in the corners of the map, the user's location and an overview map. */
import { plugins } from "../map3d";
import { addToCorner } from "./corners";

plugins["controls"] = addToCorner;
export { Control, Control as control, type ControlOptions } from "./corners";
export { Locate, Locate as locate, type Located, type LocateEvents, type LocateOptions } from "./locate";
export { Overview, Overview as overview, type OverviewOptions } from "./overview";

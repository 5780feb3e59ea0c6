/** map3d-tooltip: `bindTooltip` of image layers. Importing it is enough. */
import { features } from "../map3d";
import { bindTooltip } from "./tooltip";

features["tooltip"] = bindTooltip;
export { bindTooltip };

/** map3d-tooltip: `bindTooltip` of image layers. Importing it is enough. */
import { plugins } from "../map3d";
import { bindTooltip } from "./tooltip";

plugins["tooltip"] = bindTooltip;
export { bindTooltip };

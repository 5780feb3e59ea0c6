/** map3d-drag: markers that can be dragged (`draggable`). Importing it is enough. */
import { plugins } from "../map3d";
import { enableDragging } from "./drag";

plugins["drag"] = enableDragging;
export { enableDragging };

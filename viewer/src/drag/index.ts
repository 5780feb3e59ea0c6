/** map3d-drag: markers that can be dragged (`draggable`). Importing it is enough. */
import { features } from "../map3d";
import { enableDragging } from "./drag";

features["drag"] = enableDragging;
export { enableDragging };

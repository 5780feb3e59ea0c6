/** map3d-shade: screen-space shadows and ambient occlusion. */
import { features } from "../map3d";
import { Shade } from "./shade";

features["shade"] = Shade;
export { Shade, Shade as shade, type ShadeOptions } from "./shade";

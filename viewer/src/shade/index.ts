/** map3d-shade: screen-space shadows and ambient occlusion. */
import { features } from "../map3d";
import { shade } from "./shade";

features["shade"] = shade;
export { shade, shade as Shade, type ShadeOptions } from "./shade";

/** map3d-shade: screen-space shadows and ambient occlusion. */
import { plugins } from "../map3d";
import { Shade } from "./shade";

plugins["shade"] = Shade;
export { Shade, Shade as shade, type ShadeOptions } from "./shade";

/** map3d-shade: screen-space shadows and ambient occlusion. */
export { shade, type ShadeOptions } from "./shade";

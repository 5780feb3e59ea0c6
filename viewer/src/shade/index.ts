/** map3d-shade: shadows and occlusion from what is seen. */
export { shade, type ShadeOptions } from "./shade";

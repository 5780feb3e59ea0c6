/** map3d-print: exports the current view as an image of any size, with title, legend, scale bar, north arrow and attribution. */
export type { PictureLegend } from "./decorations";
export { exportPicture, LONGEST_SIDE_PX, type PictureOptions } from "./picture";

/** map3d-print: a map's view as a picture of any size, with what belongs to it. */
export { exportPicture, LONGEST_SIDE_PX, type PictureLegend, type PictureOptions } from "./picture";

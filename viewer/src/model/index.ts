/** map3d-model: shows 3D models between the images, drawn by the page's three.js. */
export {
  ModelLayer,
  ModelLayer as modelLayer,
  type ModelClick,
  type ModelLayerEvents,
  type ModelLayerOptions,
  type ModelSource,
  type PlayOptions,
} from "./modelLayer";
export type { ModelLoader, Three, ThreeClip } from "./threeTypes";

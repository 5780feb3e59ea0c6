/** map3d-orbit: animates changes of the view. */
export { orbit, type OrbitOptions } from "./orbit";

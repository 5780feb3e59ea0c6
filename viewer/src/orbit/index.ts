/** map3d-orbit: a change of direction is a movement. */
export { orbit, type OrbitOptions } from "./orbit";

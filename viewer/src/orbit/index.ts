/** map3d-orbit: animates changes of the view. */
import { plugins } from "../map3d";
import { Orbit } from "./orbit";

plugins["orbit"] = Orbit;
export { Orbit, Orbit as orbit, type OrbitOptions } from "./orbit";

/** map3d-orbit: animates changes of the view. */
import { features } from "../map3d";
import { Orbit } from "./orbit";

features["orbit"] = Orbit;
export { Orbit, Orbit as orbit, type OrbitOptions } from "./orbit";

/** map3d-orbit: animates changes of the view. */
import { features } from "../map3d";
import { orbit } from "./orbit";

features["orbit"] = orbit;
export { orbit, orbit as Orbit, type OrbitOptions } from "./orbit";

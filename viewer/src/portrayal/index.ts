/** map3d-portrayal: shows layers of OGC 3D Portrayal Services. */
export { portrayalSource, type PortrayalSource } from "./portrayalSource";
export { PortrayalError } from "./portrayalError";
export type { PortrayalOptions, SunDirection } from "./options";

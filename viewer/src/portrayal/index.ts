export { portrayalSource, type PortrayalSource } from "./portrayalSource";
export { PortrayalError } from "./portrayalError";
export type { PortrayalOptions, SunDirection } from "./options";

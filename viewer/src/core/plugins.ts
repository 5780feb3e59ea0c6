import { UsageError } from "./errors";

/** What entries add to the core, by their names: each registers itself when its script or module is loaded. */
export const plugins: { [name: string]: unknown } = {};

/** Returns what an entry adds. @param user what needs it  @throws UsageError when the entry is not loaded */
export function getPlugin(name: string, user: string): unknown {
  const feature = plugins[name];
  if (feature === undefined)
    throw new UsageError(`${user} needs the entry ${name}: load map3d-${name}.js after map3d.js, or import "map3d/${name}"`);
  return feature;
}

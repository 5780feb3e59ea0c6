import type { imageLayer } from "./imageLayer";

/** Layers that make one picture by depth, in the order in which they were added; none when there is nothing to combine. */
export function combinedOf(layers: readonly imageLayer[]): readonly imageLayer[] {
  const found = layers.filter((layer) => layer.combines);
  return found.length > 1 ? found : [];
}

/** Layers as they are painted, lowest first; those of a group hide each other by depth. */
export function groupsOf(layers: readonly imageLayer[]): readonly (readonly imageLayer[])[] {
  const together = combinedOf(layers);
  return layers.flatMap((layer) => (layer === together[0] ? [together] : together.includes(layer) ? [] : [[layer]]));
}

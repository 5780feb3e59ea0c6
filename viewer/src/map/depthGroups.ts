import { overlaps } from "../draw/depthMapping";
import type { imageLayer } from "./imageLayer";

/** Layers that make one picture by depth, in the order in which they were added: those that share a part of the map with another, or with guests. */
export function findCombinedLayers(layers: readonly imageLayer[], guests = false): readonly imageLayer[] {
  const able = layers.filter((layer) => layer.isCombinable);
  return able.filter((layer) => guests || able.some((other) => other !== layer && overlaps(layer.clip, other.clip)));
}

/** Layers as they are painted, lowest first; those of a group hide each other by depth. */
export function groupByDepth(layers: readonly imageLayer[]): readonly (readonly imageLayer[])[] {
  const together = findCombinedLayers(layers);
  return layers.flatMap((layer) => (layer === together[0] ? [together] : together.includes(layer) ? [] : [[layer]]));
}

import { overlaps } from "../draw/depthMapping";
import type { imageLayer } from "./imageLayer";

/** Finds the layers to combine by depth, in the order in which they were added: those that share a part of the map with another, or all if there are custom layers. */
export function findCombinedLayers(layers: readonly imageLayer[], customLayers = false): readonly imageLayer[] {
  const combinable = layers.filter((layer) => layer.isCombinable);
  return combinable.filter((layer) => customLayers || combinable.some((other) => other !== layer && overlaps(layer.clip, other.clip)));
}

/** Groups layers in drawing order, lowest first; the layers of a group hide each other by depth. */
export function groupByDepth(layers: readonly imageLayer[]): readonly (readonly imageLayer[])[] {
  const combined = findCombinedLayers(layers);
  return layers.flatMap((layer) => (layer === combined[0] ? [combined] : combined.includes(layer) ? [] : [[layer]]));
}

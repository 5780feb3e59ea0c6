import { overlaps } from "../draw/depthMapping";
import type { ImageLayer } from "./imageLayer";

/** Finds the layers to combine by depth, in the order in which they were added: those that share a part of the map with another, or all if there are custom layers. */
export function findCombinedLayers(layers: readonly ImageLayer[], customLayers = false): readonly ImageLayer[] {
  const combinable = layers.filter((layer) => layer.isCombinable);
  return combinable.filter((layer) => customLayers || combinable.some((other) => other !== layer && overlaps(layer.clip, other.clip)));
}

/** Groups layers in drawing order, lowest first; the layers of a group hide each other by depth. */
export function groupByDepth(layers: readonly ImageLayer[]): readonly (readonly ImageLayer[])[] {
  const combined = findCombinedLayers(layers);
  return layers.flatMap((layer) => (layer === combined[0] ? [combined] : combined.includes(layer) ? [] : [[layer]]));
}

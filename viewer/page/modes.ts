import type { imageLayer, Mode } from "./map3d.mjs";
import { byId } from "./dom";

const NAMES: readonly [Mode, string, string][] = [
  ["lit", "Lit", "color"],
  ["color", "Colour", "color"],
  ["normal", "Normals", "normal"],
  ["id", "Ids", "id"],
  ["depth", "Depth", "depth"],
];

/** A switch with what the rendering can show. */
export function bindModes(layer: imageLayer): void {
  const layers = layer.rendering?.layers;
  const shown = NAMES.filter(([mode, , kind]) => layers?.has(kind) && (mode !== "lit" || layers.has("normal")));
  byId("modes").append(...shown.map(([mode, name]) => choice(layer, mode, name)));
}

function choice(layer: imageLayer, mode: Mode, name: string): HTMLLabelElement {
  const label = document.createElement("label");
  const radio = document.createElement("input");
  Object.assign(radio, { type: "radio", name: "mode", value: mode, checked: layer.mode === mode });
  radio.addEventListener("change", () => layer.setMode(mode));
  label.append(radio, name);
  return label;
}

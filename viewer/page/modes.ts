import type { ImageLayer, Mode } from "./map3d.module.js";
import { byId } from "./dom";
import { message } from "./i18n";

type PageMode = Exclude<Mode, "picture">;
const MODES: readonly PageMode[] = ["lit", "color", "normal", "id", "depth"];

/** Adds a button for each mode that the rendering supports. */
export function bindModes(layer: ImageLayer): void {
  const layers = layer.rendering?.layers;
  const shown = MODES.filter((mode) => (mode === "lit" ? layers?.has("color") && layers.has("normal") : layers?.has(mode)));
  byId("modes").append(...shown.map((mode) => modeButton(layer, mode, message(mode))));
}

function modeButton(layer: ImageLayer, mode: Mode, name: string): HTMLLabelElement {
  const label = document.createElement("label");
  const radio = document.createElement("input");
  Object.assign(radio, { type: "radio", name: "mode", value: mode, checked: layer.mode === mode });
  radio.addEventListener("change", () => layer.setMode(mode));
  label.append(radio, name);
  return label;
}

import type { imageLayer, Mode } from "./map3d.mjs";
import { byId } from "./dom";
import { say } from "./i18n";

type Shown = Exclude<Mode, "picture">;
const MODES: readonly Shown[] = ["lit", "color", "normal", "id", "depth"];

/** A switch with what the rendering can show. */
export function bindModes(layer: imageLayer): void {
  const layers = layer.rendering?.layers;
  const shown = MODES.filter((mode) => (mode === "lit" ? layers?.has("color") && layers.has("normal") : layers?.has(mode)));
  byId("modes").append(...shown.map((mode) => choice(layer, mode, say(mode))));
}

function choice(layer: imageLayer, mode: Mode, name: string): HTMLLabelElement {
  const label = document.createElement("label");
  const radio = document.createElement("input");
  Object.assign(radio, { type: "radio", name: "mode", value: mode, checked: layer.mode === mode });
  radio.addEventListener("change", () => layer.setMode(mode));
  label.append(radio, name);
  return label;
}

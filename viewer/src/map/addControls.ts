import type { AddToCorner, Corner } from "../core/corner";
import { getPlugin } from "../core/plugins";
import { createAttribution, type AttributedMap } from "../ui/attribution";
import { createControls, type ControlledMap } from "../ui/controls";
import { createScaleBar, type ScaledMap } from "../ui/scaleBar";
import type { FilledOptions } from "./options";

/** Adds the buttons, the scale bar and the attribution that the options ask for to a map. */
export function addControls(
  map: ControlledMap & ScaledMap & AttributedMap & { readonly controlPane: HTMLElement },
  options: FilledOptions,
): void {
  const { controls, attribution, scaleBar = controls !== false } = options;
  const add = (control: HTMLElement, corner: Corner | true): void => {
    if (corner === true) map.controlPane.append(control);
    else (getPlugin("controls", `"${corner}"`) as AddToCorner)(map.controlPane, control, corner);
  };
  if (controls) add(createControls(map), controls);
  if (scaleBar) add(createScaleBar(map), scaleBar);
  if (attribution) add(createAttribution(map), attribution);
}

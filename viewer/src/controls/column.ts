import { element } from "../core/dom";
import type { map } from "../map3d";

/** Puts a button on top of the map's others, with something that opens beside it. */
export function besideButton(map: map, button: HTMLButtonElement, opens: HTMLElement): HTMLElement {
  const column = map.controlPane.querySelector(".map3d-buttons") ?? map.controlPane.appendChild(element("div", "map3d-buttons"));
  const box = element("div", "map3d-beside", {}, element("div", "map3d-group", {}, button), opens);
  column.prepend(box);
  return box;
}

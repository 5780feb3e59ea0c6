import { element } from "../core/dom";
import { SCALE_BAR_MAX_PX, formatLength, floorToRound } from "../core/lengths";
import { getMapMessages } from "../core/i18n";

/** A map as seen by its scale bar. */
export interface ScaledMap {
  /** Metres per CSS pixel across the screen; 0 before the map has a view. */
  readonly metresPerPixel: number;
  readonly language: string;
  on(type: "zoom" | "ready" | "directionchange", listener: () => void): unknown;
}

/** Creates a bar that is a round number of metres long. It is true across the screen; up the screen the ground is foreshortened. */
export function createScaleBar(map: ScaledMap): HTMLElement {
  const messages = getMapMessages(map.language);
  const text = element("span", "");
  const bar = element("div", "map3d-scale", { role: "img" }, text);
  const update = (): void => {
    const longest_m = SCALE_BAR_MAX_PX * map.metresPerPixel;
    bar.hidden = !(longest_m > 0);
    if (bar.hidden) return;
    const metres = floorToRound(longest_m);
    bar.style.width = `${(metres / map.metresPerPixel).toFixed(1)}px`;
    text.textContent = formatLength(metres);
    bar.setAttribute("aria-label", messages.scale(formatLength(metres)));
  };
  for (const type of ["zoom", "ready", "directionchange"] as const) map.on(type, update);
  update();
  return bar;
}

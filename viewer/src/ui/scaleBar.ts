import { element } from "../core/dom";
import { SCALE_BAR_MAX_PX, formatLength, floorToRound } from "../core/lengths";
import { getMapMessages } from "../core/i18n";

/** What the bar needs of a map. */
export interface ScaledMap {
  /** Metres a CSS pixel, across the screen; 0 while there is nothing to see. */
  readonly metresPerPixel: number;
  readonly language: string;
  on(type: "zoom" | "ready" | "directionchange", listener: () => void): unknown;
}

/** A bar as long as a round number of metres. It holds across the screen everywhere; upwards the ground is foreshortened. */
export function createScaleBar(map: ScaledMap): HTMLElement {
  const words = getMapMessages(map.language);
  const text = element("span", "");
  const bar = element("div", "map3d-scale", { role: "img" }, text);
  const show = (): void => {
    const longest_m = SCALE_BAR_MAX_PX * map.metresPerPixel;
    bar.hidden = !(longest_m > 0);
    if (bar.hidden) return;
    const metres = floorToRound(longest_m);
    bar.style.width = `${(metres / map.metresPerPixel).toFixed(1)}px`;
    text.textContent = formatLength(metres);
    bar.setAttribute("aria-label", words.scale(formatLength(metres)));
  };
  for (const type of ["zoom", "ready", "directionchange"] as const) map.on(type, show);
  show();
  return bar;
}

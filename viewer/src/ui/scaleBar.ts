import { element } from "../core/dom";
import { LONGEST_PX, lengthOf, roundBelow } from "../core/lengths";
import { wordsOf } from "../core/words";

/** What the bar needs of a map. */
export interface Scaled {
  /** Metres a CSS pixel, across the screen; 0 while there is nothing to see. */
  readonly metresPerPixel: number;
  readonly language: string;
  on(type: "zoom" | "ready" | "directionchange", listener: () => void): unknown;
}

/** A bar as long as a round number of metres. It holds across the screen everywhere; upwards the ground is foreshortened. */
export function scaleBar(map: Scaled): HTMLElement {
  const words = wordsOf(map.language);
  const text = element("span", "");
  const bar = element("div", "map3d-scale", { role: "img" }, text);
  const show = (): void => {
    const longest_m = LONGEST_PX * map.metresPerPixel;
    bar.hidden = !(longest_m > 0);
    if (bar.hidden) return;
    const metres = roundBelow(longest_m);
    bar.style.width = `${(metres / map.metresPerPixel).toFixed(1)}px`;
    text.textContent = lengthOf(metres);
    bar.setAttribute("aria-label", words.scale(lengthOf(metres)));
  };
  for (const type of ["zoom", "ready", "directionchange"] as const) map.on(type, show);
  show();
  return bar;
}

import { element } from "../core/dom";

/** A map as seen by the attribution line. */
export interface AttributedMap {
  readonly attributions: readonly string[];
  on(type: "ready" | "load", listener: () => void): unknown;
}

/** Creates the line that credits the data's sources. */
export function createAttribution(map: AttributedMap): HTMLElement {
  const line = element("p", "map3d-attribution");
  const write = (): void => {
    line.textContent = map.attributions.join(" · ");
  };
  map.on("ready", write);
  map.on("load", write);
  return line;
}

import { element } from "../core/dom";

/** What the line needs of a map. */
export interface AttributedMap {
  readonly attributions: readonly string[];
  on(type: "ready" | "load", listener: () => void): unknown;
}

/** A quiet line that names whose data is shown. */
export function createAttribution(map: AttributedMap): HTMLElement {
  const line = element("p", "map3d-attribution");
  const write = (): void => {
    line.textContent = map.attributions.join(" · ");
  };
  map.on("ready", write);
  map.on("load", write);
  return line;
}

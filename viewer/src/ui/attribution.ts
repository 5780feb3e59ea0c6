import { element } from "../core/dom";

/** A quiet line that names whose data is shown. */
export function attributionLine(map: { on(type: "ready" | "load", listener: () => void): unknown }, texts: () => readonly string[]): HTMLElement {
  const line = element("p", "map3d-attribution");
  const write = (): void => {
    line.textContent = [...new Set(texts().filter((text) => text !== ""))].join(" · ");
  };
  map.on("ready", write);
  map.on("load", write);
  return line;
}

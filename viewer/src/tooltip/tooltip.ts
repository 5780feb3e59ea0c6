import { adoptStyles, element } from "../core/dom";
import type { ImageLayer, TooltipContent } from "../map3d";
import { STYLES } from "./styles";

/** Shows a box beside the pointer while it is over an object of a layer. Returns what removes it. */
export function bindTooltip(layer: ImageLayer, content: TooltipContent, getPane: () => HTMLElement | undefined): () => void {
  adoptStyles(document, STYLES);
  const box = element("div", "map3d-tooltip", { role: "tooltip" });
  let shown = 0;
  const out = (): void => {
    shown = 0;
    box.remove();
  };
  const over = ({ id }: { id: number }): void => {
    shown = id;
    void layer
      .object(id)
      .catch(() => null)
      .then((object) => {
        const text = object && (typeof content === "string" ? content : content(object, id));
        if (shown !== id || text === null || text === "") return;
        box.replaceChildren(text);
        getPane()?.append(box);
      });
  };
  const move = ({ point: [x, y] }: { point: readonly [number, number] }): void => {
    box.style.transform = `translate(${String(x)}px, ${String(y)}px)`;
  };
  layer.on("mouseover", over).on("mousemove", move).on("mouseout", out);
  return () => {
    layer.off("mouseover", over).off("mousemove", move).off("mouseout", out);
    out();
  };
}

import { adoptStyles, element } from "../core/dom";
import { tileName } from "../geo/frame";
import { MapLayer, type Map3D } from "../map3d";
import { STYLES } from "./styles";

type Plan = Map3D["plans"][number];

/**
 * Outlines the drawn tiles and labels them with their names and, for each layer, the bytes received and how long ago. A fallback shows the
 * source tile's figures. A corner names the drawer.
 */
export class DebugTiles extends MapLayer<Map3D, object> {
  readonly #pane = element("div", "map3d-debug", { "aria-hidden": "true" });
  readonly #update = (): void => {
    const { plans, drawer } = this.map as Map3D;
    const boxes = plans.flatMap((plan) => plan.quads.map((quad) => outline(plan, quad, (this.map as Map3D).getViewState()?.dpr ?? 1)));
    this.#pane.replaceChildren(...boxes, element("p", "", {}, String(drawer)));
  };

  protected onAdd(map: Map3D): void {
    adoptStyles(document, STYLES);
    map.overlayPane.append(this.#pane);
    map.frameEvents.on("draw", this.#update);
  }

  protected onRemove(map: Map3D): void {
    map.frameEvents.off("draw", this.#update);
    this.#pane.remove();
  }
}

function outline(
  { view, layers, tiles }: Plan,
  { from, rect: [left, top, right, bottom], scale }: Plan["quads"][number],
  dpr: number,
): HTMLElement {
  const now = performance.now();
  const lines = [...layers.values()].flatMap((layer) => {
    const sent = tiles.getTransfer(view, layer, from);
    return sent ? [`${layer.name} ${(sent.bytes / 1000).toFixed(1)} kB, ${((now - sent.at_ms) / 1000).toFixed(0)} s`] : [];
  });
  // The kinds of a data tile share one line.
  const box = element("div", "", {}, [`${tileName(from)} × ${(1 / scale).toFixed(2)}`, ...new Set(lines)].join("\n"));
  box.style.transform = `translate(${String(left / dpr)}px, ${String(top / dpr)}px)`;
  box.style.width = `${String((right - left) / dpr)}px`;
  box.style.height = `${String((bottom - top) / dpr)}px`;
  return box;
}

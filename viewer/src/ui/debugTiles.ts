import { element } from "../core/dom";
import type { Drawer, Quad } from "../draw/drawer";
import { tileName } from "../geo/frame";
import type { LayerInfo, View } from "../geo/manifest";
import type { LayerTiles } from "../tiles/layerTiles";

/** The tiles that a layer draws. */
interface DebugLayer {
  readonly view: View;
  readonly layers: ReadonlyMap<string, LayerInfo>;
  readonly tiles: Pick<LayerTiles, "getTransfer">;
  readonly quads: readonly Quad[];
}

/**
 * Outlines the drawn tiles and labels them with their names and, for each layer, the bytes received and how long ago. A fallback shows the
 * source tile's figures. A corner names the drawer.
 */
export class DebugTiles {
  readonly pane = element("div", "map3d-debug", { "aria-hidden": "true" });
  #on = false;

  constructor() {
    this.pane.hidden = true;
  }

  show(on: boolean): void {
    this.#on = on;
    this.pane.hidden = !on;
    if (!on) this.pane.replaceChildren();
  }

  update(plans: readonly DebugLayer[], dpr: number, { name, note }: Pick<Drawer, "name" | "note">): void {
    if (!this.#on) return;
    const boxes = plans.flatMap((plan) => plan.quads.map((quad) => outline(plan, quad, dpr)));
    this.pane.replaceChildren(...boxes, element("p", "", {}, note ? `${name}: ${note}` : name));
  }
}

function outline({ view, layers, tiles }: DebugLayer, { from, rect: [left, top, right, bottom], scale }: Quad, dpr: number): HTMLElement {
  const now = performance.now();
  const lines = [...layers.values()].flatMap((layer) => {
    const sent = tiles.getTransfer(view, layer, from);
    return sent ? [`${layer.name} ${(sent.bytes / 1000).toFixed(1)} kB, ${((now - sent.at_ms) / 1000).toFixed(0)} s`] : [];
  });
  const box = element("div", "", {}, [`${tileName(from)} × ${(1 / scale).toFixed(2)}`, ...lines].join("\n"));
  box.style.transform = `translate(${String(left / dpr)}px, ${String(top / dpr)}px)`;
  box.style.width = `${String((right - left) / dpr)}px`;
  box.style.height = `${String((bottom - top) / dpr)}px`;
  return box;
}

import { element } from "../core/dom";
import type { Drawer, Quad } from "../draw/drawer";
import { tileName } from "../geo/frame";

/** Outlines of the painted tiles with their names; a stand-in shows the name of the tile it comes from. In a corner, what draws. */
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

  update(plans: readonly { readonly quads: readonly Quad[] }[], dpr: number, { name, note }: Pick<Drawer, "name" | "note">): void {
    if (!this.#on) return;
    const boxes = plans.flatMap(({ quads }) => quads.map((quad) => outline(quad, dpr)));
    this.pane.replaceChildren(...boxes, element("p", "", {}, note ? `${name}: ${note}` : name));
  }
}

function outline({ from, rect: [left, top, right, bottom], scale }: Quad, dpr: number): HTMLElement {
  const box = element("div", "", {}, `${tileName(from)} × ${(1 / scale).toFixed(2)}`);
  box.style.transform = `translate(${String(left / dpr)}px, ${String(top / dpr)}px)`;
  box.style.width = `${String((right - left) / dpr)}px`;
  box.style.height = `${String((bottom - top) / dpr)}px`;
  return box;
}

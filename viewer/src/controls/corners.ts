import type { AddToCorner } from "../core/corner";
import { adoptStyles, element } from "../core/dom";
import { MapLayer, UsageError, type Corner, type Map3D } from "../map3d";
import { STYLES } from "./styles";

const CORNERS: readonly string[] = ["topleft", "topright", "bottomleft", "bottomright"];

/** Adds a control to a corner of a map, below those that are there. @throws UsageError for an unknown corner */
export const addToCorner: AddToCorner = (controlPane, control, corner) => {
  checkCorner(corner);
  adoptStyles(document, STYLES);
  const box =
    controlPane.querySelector(`:scope > .map3d-${corner}`) ?? controlPane.appendChild(element("div", `map3d-corner map3d-${corner}`));
  box.append(control);
};

/** @throws UsageError for an unknown corner */
export function checkCorner(corner: Corner): Corner {
  if (!CORNERS.includes(corner)) throw new UsageError(`unknown position "${corner}"; use ${CORNERS.join(", ")}`);
  return corner;
}

/** Options of `control`. */
export interface ControlOptions {
  /** Corner of the map. Default "topright". */
  position?: Corner;
}

/** An element of the page's own in a corner of the map. */
export class Control extends MapLayer<Map3D, object> {
  /** The element. */
  readonly element: HTMLElement;
  readonly #position: Corner;

  /** @throws UsageError for an unknown corner */
  constructor(element: HTMLElement, { position = "topright" }: ControlOptions = {}) {
    super();
    this.element = element;
    this.#position = checkCorner(position);
  }

  protected onAdd(map: Map3D): void {
    addToCorner(map.controlPane, this.element, this.#position);
  }

  protected onRemove(): void {
    this.element.remove();
  }
}

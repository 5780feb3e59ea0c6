/** map3d-element: the custom elements `<map-3d>`, `<map-3d-layer>` and `<map-3d-marker>`. Importing it registers them. */
import { LayerElement } from "./layerElement";
import { MapElement, type MapElementEvents } from "./mapElement";
import { MarkerElement } from "./markerElement";

export { LayerElement, LayerElement as layerElement, MapElement, MapElement as mapElement, MarkerElement, MarkerElement as markerElement };
export type { MapElementEvents };
export type { Part, Part as part, ElementHost } from "./part";
export { embedCode, type EmbedOptions } from "./embedCode";

const ELEMENTS = { "map-3d": MapElement, "map-3d-layer": LayerElement, "map-3d-marker": MarkerElement };

// Skipped without a DOM (server-side rendering). A second copy of this script keeps the elements of the first.
if ("customElements" in globalThis)
  for (const [name, element] of Object.entries(ELEMENTS)) if (!customElements.get(name)) customElements.define(name, element);

declare global {
  interface HTMLElementTagNameMap {
    "map-3d": MapElement;
    "map-3d-layer": LayerElement;
    "map-3d-marker": MarkerElement;
  }
  interface HTMLElementEventMap extends MapElementEvents {}
  interface DocumentEventMap extends MapElementEvents {}
}

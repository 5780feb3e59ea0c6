/** map3d-element: the custom elements `<map-3d>`, `<map-3d-layer>` and `<map-3d-marker>`. Importing it registers them. */
import { layerElement } from "./layerElement";
import { mapElement, type MapElementEvents } from "./mapElement";
import { markerElement } from "./markerElement";

export { layerElement, mapElement, markerElement, type MapElementEvents };
export type { part, ElementHost } from "./part";
export { embedCode, type EmbedOptions } from "./embedCode";

const ELEMENTS = { "map-3d": mapElement, "map-3d-layer": layerElement, "map-3d-marker": markerElement };

// Skipped without a DOM (server-side rendering). A second copy of this script keeps the elements of the first.
if ("customElements" in globalThis)
  for (const [name, element] of Object.entries(ELEMENTS)) if (!customElements.get(name)) customElements.define(name, element);

declare global {
  interface HTMLElementTagNameMap {
    "map-3d": mapElement;
    "map-3d-layer": layerElement;
    "map-3d-marker": markerElement;
  }
  interface HTMLElementEventMap extends MapElementEvents {}
  interface DocumentEventMap extends MapElementEvents {}
}

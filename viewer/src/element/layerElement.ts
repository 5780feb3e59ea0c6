import { imageLayer, UsageError } from "../map3d";
import { mode, number, words } from "./attributes";
import { part, type Place } from "./part";

/** `<map-3d-layer src="…" mode="…" opacity="…" attribution="…">` inside `<map-3d>`: a further rendering over those before. */
export class layerElement extends part<imageLayer> {
  /** @internal */
  static readonly observedAttributes = ["src", "mode", "opacity", "attribution"];

  /** null while it is on no map. */
  get layer(): imageLayer | null {
    return this.item;
  }

  protected make(): imageLayer {
    return layerOf(this);
  }

  protected follow(layer: imageLayer, name: string): boolean {
    return followLayer(this, layer, name);
  }

  protected added(layer: imageLayer, place: Place): void {
    place.watch(layer);
  }

  protected taken(): void {
    // Nothing of it stays.
  }
}

/** The layer that an element's attributes describe. @throws UsageError */
export function layerOf(element: Element): imageLayer {
  const [urls, opacity, shown, attribution] = [words(element, "src"), number(element, "opacity"), mode(element), element.getAttribute("attribution")];
  if (urls.length === 0) throw new UsageError(`<${element.localName}> needs src, the base URL of a rendering`);
  return new imageLayer(urls, { ...(shown !== undefined && { mode: shown }), ...(opacity !== undefined && { opacity }), ...(attribution !== null && { attribution }) });
}

/** Brings an attribute to a layer; false: the layer cannot change it. @throws UsageError */
export function followLayer(element: Element, layer: imageLayer, name: string): boolean {
  if (name === "mode") layer.setMode(mode(element) ?? "lit");
  else if (name === "opacity") layer.setOpacity(number(element, name) ?? 1);
  else return false;
  return true;
}

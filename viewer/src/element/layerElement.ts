import { ImageLayer, UsageError } from "../map3d";
import { mode, number, words } from "./attributes";
import { Part, type ElementHost } from "./part";

/** `<map-3d-layer src="…" mode="…" opacity="…" attribution="…">` inside `<map-3d>`: a further rendering on the map. */
export class LayerElement extends Part<ImageLayer> {
  /** @internal */
  static readonly observedAttributes = ["src", "mode", "opacity", "attribution"];

  /** The layer; null while the element is not on a map. */
  get layer(): ImageLayer | null {
    return this.item;
  }

  protected create(): ImageLayer {
    return createLayer(this);
  }

  protected update(layer: ImageLayer, name: string): boolean {
    return updateLayer(this, layer, name);
  }

  protected added(layer: ImageLayer, host: ElementHost): void {
    host.watch(layer);
  }

  protected removed(): void {
    // Nothing to clean up.
  }
}

/** Creates the layer that an element's attributes describe. @throws UsageError */
export function createLayer(element: Element): ImageLayer {
  const [urls, opacity, shown, attribution] = [
    words(element, "src"),
    number(element, "opacity"),
    mode(element),
    element.getAttribute("attribution"),
  ];
  if (urls.length === 0) throw new UsageError(`<${element.localName}> needs the attribute src, the base URL of a rendering`);
  return new ImageLayer(urls, {
    ...(shown !== undefined && { mode: shown }),
    ...(opacity !== undefined && { opacity }),
    ...(attribution !== null && { attribution }),
  });
}

/** Applies a changed attribute to the layer. @returns false when the layer cannot change it  @throws UsageError */
export function updateLayer(element: Element, layer: ImageLayer, name: string): boolean {
  if (name === "mode") layer.setMode(mode(element) ?? "lit");
  else if (name === "opacity") layer.setOpacity(number(element, name) ?? 1);
  else return false;
  return true;
}

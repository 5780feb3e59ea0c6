import { Marker, UsageError, type AnyPosition } from "../map3d";
import { place } from "./attributes";
import { Part, type ElementHost } from "./part";

/**
 * `<map-3d-marker position="x y z" label="…" color="…" open>` inside `<map-3d>`: a labelled position in the scene's CRS, metres; or with `lonlat="longitude latitude"`, or `object="gml:id"`. Its content is shown in a
 * popup, which `open` opens at once. The content is moved to the popup, not copied, and moves back when the marker leaves the map.
 */
export class MarkerElement extends Part<Marker> {
  /** @internal */
  static readonly observedAttributes = ["position", "lonlat", "object", "label", "color", "open"];
  #body: HTMLElement | null = null;
  #observer: MutationObserver | null = null;

  /** The marker; null while the element is not on a map. */
  get marker(): Marker | null {
    return this.item;
  }

  protected create(): Marker {
    const [label, at, color] = [this.getAttribute("label")?.trim() ?? "", this.#place, this.getAttribute("color")];
    if (label === "") throw new UsageError("<map-3d-marker> needs the attribute label, its visible and accessible name");
    if (!at)
      throw new UsageError(
        `<map-3d-marker label="${label}"> needs the attribute position: x, y and z in the scene's CRS, such as "691000 5336000 520"; or lonlat, such as "11.42 48.76"; or object, such as a gml:id`,
      );
    return new Marker(label, at, color === null ? {} : { color });
  }

  protected update(item: Marker, name: string): boolean {
    const [label, at] = [this.getAttribute("label")?.trim() ?? "", this.#place];
    if (label === "" || !at || name === "color") return false;
    if (name === "label") item.setLabel(label);
    else if (name !== "open") item.setPosition(at);
    else if (this.hasAttribute("open")) item.openPopup();
    else item.closePopup();
    return true;
  }

  get #place(): AnyPosition | undefined {
    const object = this.getAttribute("object")?.trim() ?? "";
    return object === "" ? place(this, "position") : { object };
  }

  protected override isReady(host: ElementHost): boolean {
    return host.map !== null && host.drawn;
  }

  protected added(item: Marker): void {
    this.#body ??= document.createElement("div");
    this.#observer = new MutationObserver(() => this.#moveContent(item));
    this.#observer.observe(this, { childList: true });
    this.#moveContent(item);
  }

  protected removed(): void {
    this.#observer?.disconnect();
    this.#observer = null;
    if (this.#body) this.append(...this.#body.childNodes);
  }

  /** Moves the element's content to the popup, now and when it changes. */
  #moveContent(item: Marker): void {
    const body = this.#body;
    if (!body) return;
    const wasEmpty = !hasContent(body);
    body.append(...this.childNodes);
    if (wasEmpty && hasContent(body)) item.bindPopup(body);
    if (wasEmpty && hasContent(body) && this.hasAttribute("open")) item.openPopup();
  }
}

const hasContent = (body: HTMLElement): boolean => body.childElementCount > 0 || body.textContent.trim() !== "";

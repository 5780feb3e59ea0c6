import { marker, UsageError } from "../map3d";
import { position } from "./attributes";
import { part, type Place } from "./part";

/**
 * `<map-3d-marker position="x y z" label="…" color="…" open>` inside `<map-3d>`: a labelled position of the scene's CRS, metres. What is inside is shown in
 * a popup, which `open` opens at once; it is moved there, not copied, and comes back when the marker leaves the map.
 */
export class markerElement extends part<marker> {
  /** @internal */
  static readonly observedAttributes = ["position", "label", "color", "open"];
  #body: HTMLElement | null = null;
  #watch: MutationObserver | null = null;

  /** null while it is on no map. */
  get marker(): marker | null {
    return this.item;
  }

  protected make(): marker {
    const [label, at, color] = [this.getAttribute("label")?.trim() ?? "", position(this, "position"), this.getAttribute("color")];
    if (label === "") throw new UsageError("a <map-3d-marker> needs a label, which is shown and read aloud");
    if (!at) throw new UsageError(`<map-3d-marker label="${label}"> needs a position: x, y and z of the scene's CRS, such as "691000 5336000 520"`);
    return new marker(label, at, color === null ? {} : { color });
  }

  protected follow(item: marker, name: string): boolean {
    const [label, at] = [this.getAttribute("label")?.trim() ?? "", position(this, "position")];
    if (label === "" || !at || name === "color") return false;
    if (name === "label") item.setLabel(label);
    else if (name === "position") item.setPosition(at);
    else if (this.hasAttribute("open")) item.openPopup();
    else item.closePopup();
    return true;
  }

  protected override fits(place: Place): boolean {
    return place.map !== null && place.drawn;
  }

  protected added(item: marker): void {
    this.#body ??= document.createElement("div");
    this.#watch = new MutationObserver(() => { this.#gather(item); });
    this.#watch.observe(this, { childList: true });
    this.#gather(item);
  }

  protected taken(): void {
    this.#watch?.disconnect();
    this.#watch = null;
    if (this.#body) this.append(...this.#body.childNodes);
  }

  /** Takes what is inside, also what comes later, into the popup. */
  #gather(item: marker): void {
    const body = this.#body;
    if (!body) return;
    const first = !filled(body);
    body.append(...this.childNodes);
    if (first && filled(body)) item.bindPopup(body);
    if (first && filled(body) && this.hasAttribute("open")) item.openPopup();
  }
}

const filled = (body: HTMLElement): boolean => body.childElementCount > 0 || body.textContent.trim() !== "";

import { asError } from "../core/errors";
import { MapLayer } from "../core/mapLayer";
import type { OverlayEvents, OverlayHost } from "../core/overlayHost";
import { checkPosition, isVector, type AnyPosition } from "../core/position";
import type { Vec3 } from "../core/vec";

/** An overlay whose element follows a position. */
export abstract class PositionedLayer<E extends object> extends MapLayer<OverlayHost, E> {
  #given: AnyPosition;
  readonly #update = (): void => {
    if (this.map) this.placeElement(this.map, this.position);
  };

  constructor(position: AnyPosition) {
    super();
    this.#given = checkPosition(position, "position");
  }

  /** World coordinates; null until a map has found those of longitude and latitude, of the ground or of an object. */
  get position(): Vec3 | null {
    return isVector(this.#given) ? this.#given : null;
  }

  /** Sets the position. @throws UsageError for anything but a position */
  setPosition(position: AnyPosition): this {
    this.#given = checkPosition(position, "setPosition");
    if (this.map) this.#find(this.map);
    this.#update();
    return this;
  }

  /** Shows an element in the overlay pane, and places it again at each event of a type. */
  protected showElement(map: OverlayHost, element: HTMLElement, event: keyof OverlayEvents): void {
    map.overlayPane.append(element);
    map.frameEvents.on(event, this.#update);
    this.#find(map);
    this.#update();
  }

  protected override onRemove(map: OverlayHost): void {
    map.frameEvents.off("move", this.#update).off("draw", this.#update);
  }

  /** Moves the element to its position on the screen; hides it while that is not known. */
  protected abstract placeElement(map: OverlayHost, position: Vec3 | null): void;

  #find(map: OverlayHost): void {
    const given = this.#given;
    if (isVector(given)) return;
    map
      .findPosition(given)
      .then((found) => {
        if (this.#given === given && this.map === map) this.setPosition(found);
      })
      .catch((reason: unknown) => map.report(asError(reason)));
  }
}

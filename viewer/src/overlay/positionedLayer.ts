import { checkVector } from "../core/check";
import { MapLayer } from "../core/mapLayer";
import type { OverlayEvents, OverlayHost } from "../core/overlayHost";
import type { Vec3 } from "../core/vec";

/** An overlay whose element follows a world position. */
export abstract class PositionedLayer<E extends object> extends MapLayer<OverlayHost, E> {
  #position: Vec3;
  readonly #update = (): void => {
    if (this.map) this.placeElement(this.map);
  };

  constructor(position: Vec3) {
    super();
    this.#position = checkVector(position, "position");
  }

  /** World coordinates. */
  get position(): Vec3 {
    return this.#position;
  }

  /** World coordinates. @throws UsageError for anything but three numbers */
  setPosition(position: Vec3): this {
    this.#position = checkVector(position, "setPosition");
    this.#update();
    return this;
  }

  /** Shows an element in the overlay pane, and places it again at each event of a type. */
  protected showElement(map: OverlayHost, element: HTMLElement, event: keyof OverlayEvents): void {
    map.overlayPane.append(element);
    map.frameEvents.on(event, this.#update);
    this.#update();
  }

  protected override onRemove(map: OverlayHost): void {
    map.frameEvents.off("move", this.#update).off("draw", this.#update);
  }

  /** Moves the element to its position on the screen. */
  protected abstract placeElement(map: OverlayHost): void;
}

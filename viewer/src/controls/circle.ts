import type { Vec3 } from "../core/vec";
import type { map } from "../map3d";

const NS = "http://www.w3.org/2000/svg";
const CORNERS = 64;

/** A level circle of so many metres, which follows the picture. */
export class Circle {
  readonly #svg = document.createElementNS(NS, "svg");
  readonly #path = this.#svg.appendChild(document.createElementNS(NS, "path"));
  #leave: () => void = () => undefined;

  constructor() {
    this.#svg.setAttribute("class", "map3d-accuracy");
    this.#svg.setAttribute("aria-hidden", "true");
  }

  addTo(map: map, [x, y, z]: Vec3, radius_m: number): void {
    const around = Array.from({ length: CORNERS }, (_, k) => (2 * Math.PI * k) / CORNERS).map((angle): Vec3 => [x + radius_m * Math.cos(angle), y + radius_m * Math.sin(angle), z]);
    const place = (): void => {
      const points = around.flatMap((point) => {
        const at = map.project(point);
        return at ? [`${at[0].toFixed(1)} ${at[1].toFixed(1)}`] : [];
      });
      this.#path.setAttribute("d", points.length > 0 ? `M${points.join("L")}Z` : "");
    };
    this.remove();
    map.overlayPane.prepend(this.#svg);
    map.frameEvents.on("move", place);
    this.#leave = () => { map.frameEvents.off("move", place); };
    place();
  }

  remove(): void {
    this.#leave();
    this.#svg.remove();
  }
}

import type { Vec3 } from "../core/vec";
import type { Map3D } from "../map3d";

const NS = "http://www.w3.org/2000/svg";
const CORNERS = 64;

/** A horizontal circle on the map that shows the accuracy of a position. */
export class AccuracyCircle {
  readonly #svg = document.createElementNS(NS, "svg");
  readonly #path = this.#svg.appendChild(document.createElementNS(NS, "path"));
  #stopFollowing: () => void = () => undefined;

  constructor() {
    this.#svg.setAttribute("class", "map3d-accuracy");
    this.#svg.setAttribute("aria-hidden", "true");
  }

  addTo(map: Map3D, [x, y, z]: Vec3, radius_m: number): void {
    const corners = Array.from({ length: CORNERS }, (_, k) => (2 * Math.PI * k) / CORNERS).map((angle): Vec3 => [
      x + radius_m * Math.cos(angle),
      y + radius_m * Math.sin(angle),
      z,
    ]);
    const update = (): void => {
      const points = corners.flatMap((point) => {
        const at = map.project(point);
        return at ? [`${at[0].toFixed(1)} ${at[1].toFixed(1)}`] : [];
      });
      this.#path.setAttribute("d", points.length > 0 ? `M${points.join("L")}Z` : "");
    };
    this.remove();
    map.overlayPane.prepend(this.#svg);
    map.frameEvents.on("move", update);
    this.#stopFollowing = () => map.frameEvents.off("move", update);
    update();
  }

  remove(): void {
    this.#stopFollowing();
    this.#svg.remove();
  }
}

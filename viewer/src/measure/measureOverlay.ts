import { element } from "../core/dom";
import type { Vec2, Vec3 } from "../core/vec";

const NS = "http://www.w3.org/2000/svg";

/** A text at a world position. */
export interface MeasureLabel {
  readonly at: Vec3;
  readonly text: string;
  /** True for the total. */
  readonly main: boolean;
}

/** Lines, corners and labels drawn over the map. */
export class MeasureOverlay {
  readonly box = element("div", "map3d-measure", { role: "status", "aria-live": "polite" });
  readonly #svg = document.createElementNS(NS, "svg");
  readonly #halo = this.#path("map3d-measure-halo");
  readonly #line = this.#path("map3d-measure-line");
  readonly #labels = element("div", "");
  #points: readonly Vec3[] = [];
  #course: readonly (Vec3 | null)[] | null = null;
  #closed = false;
  readonly #markCircle = document.createElementNS(NS, "circle");
  #markPosition: Vec3 | null = null;
  #items: { label: MeasureLabel; span: HTMLElement }[] = [];

  constructor() {
    this.#svg.setAttribute("aria-hidden", "true");
    this.#markCircle.setAttribute("r", "7");
    this.#markCircle.setAttribute("class", "map3d-measure-mark");
    this.box.append(this.#svg, this.#labels);
  }

  /** Sets the corners and labels. @param closed fills the polygon */
  set(points: readonly Vec3[], closed: boolean, labels: readonly MeasureLabel[]): void {
    this.#points = points;
    this.#course = null;
    this.#closed = closed;
    this.#items = labels.map((label) => ({ label, span: element("span", label.main ? "map3d-measure-main" : "", {}, label.text) }));
    this.#labels.replaceChildren(...this.#items.map(({ span }) => span));
  }

  /** Draws the line through these positions, with gaps at null, instead of straight between the corners. */
  setCourse(course: readonly (Vec3 | null)[]): void {
    this.#course = course;
  }

  /** Marks a position; null removes the mark. */
  mark(position: Vec3 | null): void {
    this.#markPosition = position;
    if (position) this.#svg.append(this.#markCircle);
    else this.#markCircle.remove();
  }

  /** Updates all positions on the screen. */
  update(project: (world: Vec3) => Vec2 | null): void {
    const corners = this.#points.flatMap((point) => {
      const at = project(point);
      return at ? [at] : [];
    });
    const shape = this.#course
      ? svgPath(this.#course.map((position) => position && project(position)))
      : svgPath(corners) + (this.#closed && corners.length > 2 ? "Z" : "");
    for (const path of [this.#halo, this.#line]) path.setAttribute("d", shape);
    this.#line.classList.toggle("map3d-measure-filled", this.#closed);
    this.#placeCorners(corners);
    const [x = -99, y = -99] = (this.#markPosition && project(this.#markPosition)) ?? [];
    this.#markCircle.setAttribute("cx", x.toFixed(1));
    this.#markCircle.setAttribute("cy", y.toFixed(1));
    for (const { label, span } of this.#items) {
      const at = project(label.at);
      span.hidden = !at;
      if (at)
        span.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px) translate(-50%, ${label.main ? "-160%" : "-50%"})`;
    }
  }

  #placeCorners(corners: readonly Vec2[]): void {
    const dots = [...this.#svg.querySelectorAll<SVGCircleElement>("circle:not(.map3d-measure-mark)")];
    while (dots.length > corners.length) dots.pop()?.remove();
    while (dots.length < corners.length) {
      const dot = document.createElementNS(NS, "circle");
      dot.setAttribute("r", "4.5");
      this.#svg.append(dot);
      dots.push(dot);
    }
    corners.forEach(([x, y], k) => {
      dots[k]?.setAttribute("cx", x.toFixed(1));
      dots[k]?.setAttribute("cy", y.toFixed(1));
    });
  }

  #path(classes: string): SVGPathElement {
    const path = document.createElementNS(NS, "path");
    path.setAttribute("class", classes);
    this.#svg.append(path);
    return path;
  }
}

/** Returns an SVG path through points, with gaps at null. */
function svgPath(points: readonly (Vec2 | null)[]): string {
  return points.map((point, k) => (point ? `${points[k - 1] ? "L" : "M"}${point[0].toFixed(1)} ${point[1].toFixed(1)}` : "")).join("");
}

import { element } from "../core/dom";
import type { Vec2, Vec3 } from "../core/vec";

const NS = "http://www.w3.org/2000/svg";

/** A text at a place of the world. */
export interface Note {
  readonly at: Vec3;
  readonly text: string;
  /** The one that sums up. */
  readonly main: boolean;
}

/** Lines, corners and texts that lie over the picture and follow it. */
export class Sketch {
  readonly box = element("div", "map3d-measure", { role: "status", "aria-live": "polite" });
  readonly #svg = document.createElementNS(NS, "svg");
  readonly #halo = this.#path("map3d-measure-halo");
  readonly #line = this.#path("map3d-measure-line");
  readonly #notes = element("div", "");
  #points: readonly Vec3[] = [];
  #course: readonly (Vec3 | null)[] | null = null;
  #closed = false;
  readonly #marked = document.createElementNS(NS, "circle");
  #mark: Vec3 | null = null;
  #shown: { note: Note; label: HTMLElement }[] = [];

  constructor() {
    this.#svg.setAttribute("aria-hidden", "true");
    this.#marked.setAttribute("r", "7");
    this.#marked.setAttribute("class", "map3d-measure-mark");
    this.box.append(this.#svg, this.#notes);
  }

  /** @param closed fills the polygon */
  set(points: readonly Vec3[], closed: boolean, notes: readonly Note[]): void {
    this.#points = points;
    this.#course = null;
    this.#closed = closed;
    this.#shown = notes.map((note) => ({ note, label: element("span", note.main ? "map3d-measure-main" : "", {}, note.text) }));
    this.#notes.replaceChildren(...this.#shown.map(({ label }) => label));
  }

  /** Draws the line over these places, with gaps at null, in place of straight from corner to corner. */
  follow(course: readonly (Vec3 | null)[]): void {
    this.#course = course;
  }

  /** Marks a place besides the corners; null: none. */
  mark(place: Vec3 | null): void {
    this.#mark = place;
    if (place) this.#svg.append(this.#marked);
    else this.#marked.remove();
  }

  /** Puts everything where the world is now. */
  place(project: (world: Vec3) => Vec2 | null): void {
    const corners = this.#points.flatMap((point) => {
      const at = project(point);
      return at ? [at] : [];
    });
    const shape = this.#course ? lineOver(this.#course.map((place) => place && project(place))) : lineOver(corners) + (this.#closed && corners.length > 2 ? "Z" : "");
    for (const path of [this.#halo, this.#line]) path.setAttribute("d", shape);
    this.#line.classList.toggle("map3d-measure-filled", this.#closed);
    this.#placeCorners(corners);
    const [x = -99, y = -99] = (this.#mark && project(this.#mark)) ?? [];
    this.#marked.setAttribute("cx", x.toFixed(1));
    this.#marked.setAttribute("cy", y.toFixed(1));
    for (const { note, label } of this.#shown) {
      const at = project(note.at);
      label.hidden = !at;
      if (at) label.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px) translate(-50%, ${note.main ? "-160%" : "-50%"})`;
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

/** An SVG path over points, broken at null. */
function lineOver(points: readonly (Vec2 | null)[]): string {
  return points.map((point, k) => (point ? `${points[k - 1] ? "L" : "M"}${point[0].toFixed(1)} ${point[1].toFixed(1)}` : "")).join("");
}

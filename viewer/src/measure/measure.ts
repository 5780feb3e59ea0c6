import { adoptStyles } from "../core/dom";
import type { Vec3 } from "../core/vec";
import { Attached, type ClickEvent, type map } from "../map3d";
import { measureArea, measureLine, type AreaMeasure, type LineMeasure } from "./geometry";
import { Sketch, type Note } from "./sketch";
import { STYLES } from "./styles";
import { Words } from "./words";

export interface MeasureOptions {
  /** A line over the surface, or a polygon on it. Default "line". */
  kind?: "line" | "area";
  /** BCP 47, of the numbers. Default the map's. */
  language?: string;
}

/** A corner: where the surface was clicked. */
export interface Corner {
  /** World coordinates. */
  readonly position: Vec3;
  /** Read above the deepest level, so only about right. */
  readonly approximate: boolean;
}

export interface MeasureEvents {
  /** A corner came or went. */
  change: { corners: readonly Corner[]; line: LineMeasure; area: AreaMeasure };
}

/**
 * Measures on the surface: each click sets a corner; Backspace takes the last one back, Escape all. Positions are those of the deepest level, whatever
 * level is shown.
 */
export class measure extends Attached<map, MeasureEvents> {
  readonly options: Required<Omit<MeasureOptions, "language">> & Pick<MeasureOptions, "language">;
  #words = new Words(undefined);
  readonly #sketch = new Sketch();
  #corners: readonly Corner[] = [];

  constructor({ kind = "line", ...options }: MeasureOptions = {}) {
    super();
    this.options = { kind, ...options };
  }

  /** In the order in which they were set. */
  get corners(): readonly Corner[] {
    return this.#corners;
  }

  /** Of the corners as a line. */
  get line(): LineMeasure {
    return measureLine(this.#corners.map(({ position }) => position));
  }

  /** Of the corners as a polygon; zeros for less than three. */
  get area(): AreaMeasure {
    return measureArea(this.#corners.map(({ position }) => position));
  }

  /** Replaces all corners. */
  setCorners(corners: readonly Corner[]): this {
    this.#corners = corners;
    this.#draw();
    return this.fire("change", { corners, line: this.line, area: this.area });
  }

  /** Takes the last corner back. */
  undo(): this {
    return this.setCorners(this.#corners.slice(0, -1));
  }

  /** Takes all corners back. */
  clear(): this {
    return this.setCorners([]);
  }

  protected enter(map: map): void {
    this.#words = new Words(this.options.language ?? map.language);
    adoptStyles(document, STYLES);
    map.overlayPane.append(this.#sketch.box);
    map.moves.on("move", this.#place);
    map.on("click", this.#clicked);
    map.container.addEventListener("keydown", this.#pressed);
    this.#draw();
  }

  protected leave(map: map): void {
    map.moves.off("move", this.#place);
    map.off("click", this.#clicked);
    map.container.removeEventListener("keydown", this.#pressed);
    this.#sketch.box.remove();
  }

  readonly #clicked = ({ position, approximate }: ClickEvent): void => {
    if (position) this.setCorners([...this.#corners, { position, approximate }]);
  };

  readonly #pressed = ({ key }: KeyboardEvent): void => {
    if (key === "Backspace") this.undo();
    else if (key === "Escape") this.clear();
  };

  readonly #place = (): void => {
    this.#sketch.place((world) => this.map?.project(world) ?? null);
  };

  #draw(): void {
    const points = this.#corners.map(({ position }) => position);
    this.#sketch.set(points, this.options.kind === "area", this.options.kind === "area" ? this.#areaNotes(points) : this.#lineNotes(points));
    this.#place();
  }

  #lineNotes(points: readonly Vec3[]): Note[] {
    const last = points.at(-1);
    if (!last || points.length < 2) return [];
    const { length_m, rise_m, steps_m } = this.line;
    const steps = steps_m.length < 2 ? [] : steps_m.map((step, k) => ({ at: between(points[k] as Vec3, points[k + 1] as Vec3), text: this.#words.length(step), main: false }));
    return [...steps, { at: last, text: `${this.#about()}${this.#words.length(length_m)}  ${this.#words.rise(rise_m)}`, main: true }];
  }

  #areaNotes(points: readonly Vec3[]): Note[] {
    if (points.length < 3) return [];
    const { area_m2, slope_deg } = this.area;
    const middle = points.reduce<Vec3>((sum, point) => between(sum, point, 1 / points.length, 1), [0, 0, 0]);
    return [{ at: middle, text: `${this.#about()}${this.#words.area(area_m2)}  ∠ ${slope_deg.toFixed(0)}°`, main: true }];
  }

  /** Said before a number that is not exact. */
  #about(): string {
    return this.#corners.some(({ approximate }) => approximate) ? "≈ " : "";
  }
}

const between = (a: Vec3, b: Vec3, share = 0.5, rest = 1 - share): Vec3 => [a[0] * rest + b[0] * share, a[1] * rest + b[1] * share, a[2] * rest + b[2] * share];

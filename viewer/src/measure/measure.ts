import { adoptStyles } from "../core/dom";
import { asError } from "../core/errors";
import type { Vec3 } from "../core/vec";
import { MapLayer, type ClickEvent, type map } from "../map3d";
import { measureArea, measureLine, type AreaMeasure, type LineMeasure } from "./geometry";
import { Chart } from "./chart";
import { measureFace, type Face } from "./face";
import { along, measureProfile, type Profile } from "./profile";
import { Sketch, type Note } from "./sketch";
import { STYLES } from "./styles";
import { MeasureMessages } from "./i18n";

export interface MeasureOptions {
  /** A line over the surface; the face under the first corner, then a polygon; or the heights along a line. Default "line". */
  kind?: "line" | "area" | "profile";
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
  /** The face under the only corner is known; null: nothing flat is there. */
  face: { face: Face | null };
  /** The heights along the corners are known. */
  profile: { profile: Profile };
}

/**
 * Measures on the surface: each click sets a corner; Backspace takes the last one back, Escape all. Positions are those of the deepest level, whatever
 * level is shown.
 */
export class measure extends MapLayer<map, MeasureEvents> {
  readonly options: Required<Omit<MeasureOptions, "language">> & Pick<MeasureOptions, "language">;
  #words = new MeasureMessages(undefined);
  readonly #sketch = new Sketch();
  readonly #chart = new Chart((at) => { this.#walk(at); });
  #corners: readonly Corner[] = [];
  #profile: Profile | null = null;
  #face: Face | null = null;
  #direction = "";
  #reading = new AbortController();

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
    return measureLine(this.#points());
  }

  /** Of the corners as a polygon; zeros for less than three. */
  get area(): AreaMeasure {
    return measureArea(this.#points());
  }

  /** Heights along the corners; null while they are not known, and for another kind. */
  get profile(): Profile | null {
    return this.#profile;
  }

  /** Of the surface under the only corner, for the kind "area"; null while it is not known, or nothing flat is there. */
  get face(): Face | null {
    return this.#face;
  }

  /** Replaces all corners. */
  setCorners(corners: readonly Corner[]): this {
    [this.#corners, this.#face] = [corners, null];
    this.#draw();
    void this.#read();
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

  protected onAdd(map: map): void {
    this.#words = new MeasureMessages(this.options.language ?? map.language);
    adoptStyles(document, STYLES);
    map.overlayPane.append(this.#sketch.box);
    map.frameEvents.on("move", this.#place);
    map.on("click", this.#clicked);
    map.container.addEventListener("keydown", this.#pressed);
    this.#draw();
    map.on("moveend", this.#turned);
    void this.#read();
  }

  protected onRemove(map: map): void {
    map.frameEvents.off("move", this.#place);
    map.off("click", this.#clicked);
    map.container.removeEventListener("keydown", this.#pressed);
    map.off("moveend", this.#turned);
    this.#reading.abort();
    this.#sketch.box.remove();
    this.#closeChart();
  }

  readonly #clicked = ({ position, approximate }: ClickEvent): void => {
    if (position) this.setCorners([...this.#corners, { position, approximate }]);
  };

  readonly #pressed = ({ key }: KeyboardEvent): void => {
    if (key === "Backspace") this.undo();
    else if (key === "Escape") this.clear();
  };

  /** What is seen along the line is another in another direction. */
  readonly #turned = (): void => {
    const seen = this.map?.direction ?? "";
    if (this.options.kind === "profile" && seen !== this.#direction) void this.#read();
  };

  /** Reads what the corners alone do not tell: the heights along them, or the face under the only one. */
  async #read(): Promise<void> {
    this.#reading.abort();
    [this.#profile, this.#face] = [null, null];
    const { map, options: { kind } } = this;
    const count = this.#corners.length;
    const { signal } = (this.#reading = new AbortController());
    if (kind !== "profile" || count < 2) this.#closeChart();
    if (!map) return;
    this.#direction = map.direction;
    const reading = kind === "profile" && count > 1 ? this.#readProfile(map, signal) : kind === "area" && count === 1 ? this.#readFace(map, signal) : null;
    await reading?.catch((reason: unknown) => {
      if (!signal.aborted) map.layerContext?.report(asError(reason));
    });
  }

  async #readFace(map: map, signal: AbortSignal): Promise<void> {
    const face = await measureFace(map, this.#points()[0] as Vec3, { signal });
    if (signal.aborted) return;
    this.#face = face;
    this.#draw();
    this.fire("face", { face });
  }

  async #readProfile(map: map, signal: AbortSignal): Promise<void> {
    const profile = await measureProfile(map, this.#points(), { signal });
    if (signal.aborted) return;
    this.#profile = profile;
    const places = along(this.#points(), profile.heights_m.length);
    this.#sketch.follow(places.map(({ place: [x, y] }, k) => (Number.isNaN(profile.heights_m[k]) ? null : [x, y, profile.heights_m[k] as number])));
    this.#place();
    this.#chart.set(profile, this.#words, profile.approximate ? "≈ " : "");
    map.overlayPane.append(this.#chart.box);
    this.fire("profile", { profile });
  }

  /** A pointer may be over it. */
  #closeChart(): void {
    this.#chart.box.remove();
    this.#sketch.mark(null);
  }

  /** Marks the place on the map that the reader of the profile is at. */
  #walk(at: number | null): void {
    const { heights_m } = this.#profile ?? {};
    const height = at === null ? NaN : (heights_m?.[at] ?? NaN);
    const { place } = (at !== null && heights_m && along(this.#points(), heights_m.length)[at]) || {};
    this.#sketch.mark(place && !Number.isNaN(height) ? [place[0], place[1], height] : null);
    this.#place();
  }

  #points(): Vec3[] {
    return this.#corners.map(({ position }) => position);
  }

  readonly #place = (): void => {
    this.#sketch.place((world) => this.map?.project(world) ?? null);
  };

  #draw(): void {
    const points = this.#points();
    this.#sketch.set(points, this.options.kind === "area", this.options.kind === "area" ? this.#areaNotes(points) : this.#lineNotes(points));
    if (this.#face) this.#sketch.follow(this.#face.outline.flatMap((loop) => [...loop, loop[0] as Vec3, null]));
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
    const [first] = points;
    if (this.#face && first) return [{ at: first, text: this.#areaText(this.#face, this.#face), main: true }];
    if (points.length < 3) return [];
    const middle = points.reduce<Vec3>((sum, point) => between(sum, point, 1 / points.length, 1), [0, 0, 0]);
    return [{ at: middle, text: this.#areaText(this.area, {}), main: true }];
  }

  #areaText({ area_m2, slope_deg }: Pick<AreaMeasure, "area_m2" | "slope_deg">, { hidden = false, approximate = false }: Partial<Face>): string {
    return `${approximate ? "≈ " : this.#about()}${hidden ? "≥ " : ""}${this.#words.area(area_m2)}  ∠ ${slope_deg.toFixed(0)}°`;
  }

  /** Said before a number that is not exact. */
  #about(): string {
    return this.#corners.some(({ approximate }) => approximate) ? "≈ " : "";
  }
}

const between = (a: Vec3, b: Vec3, share = 0.5, rest = 1 - share): Vec3 => [a[0] * rest + b[0] * share, a[1] * rest + b[1] * share, a[2] * rest + b[2] * share];

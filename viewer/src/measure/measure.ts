import { adoptStyles } from "../core/dom";
import { asError } from "../core/errors";
import { sub, type Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import { MapLayer, type ClickEvent, type Map3D } from "../map3d";
import { measureArea, measureLine, type AreaMeasure, type LineMeasure } from "./geometry";
import { ProfileChart } from "./profileChart";
import { measureFace, type Face } from "./face";
import { samplePoints, measureProfile, type Profile } from "./profile";
import { MeasureOverlay, type MeasureLabel } from "./measureOverlay";
import { STYLES } from "./styles";
import { MeasureMessages } from "./i18n";

export interface MeasureOptions {
  /** "line" measures a polyline, "height" the height difference of two points, "area" a face (one corner) or a polygon, "profile" the heights along a line. Default "line". */
  kind?: "line" | "height" | "area" | "profile";
  /** BCP 47 tag for numbers. Default: the map's. */
  language?: string;
}

/** A corner: a clicked position on the surface. */
export interface MeasureCorner {
  /** World coordinates. */
  readonly position: Vec3;
  /** Read above the deepest level. */
  readonly approximate: boolean;
  /** Something nearer ends beside the click, which perhaps meant that. */
  readonly pastEdge?: boolean;
}

/** An edge so near to a click, in CSS pixels, makes it doubtful. A finger is less exact than a mouse. */
const EDGE_PX = 6;
/** What is nearer than the click by this many metres, and this many times the distance on the screen, is in front of it. */
const [EDGE_M, EDGE_SLOPE] = [1, 4];
/** Points of a height this far from one vertical, in metres and as a share of the height, are not one above the other. */
const [PLUMB_M, PLUMB_SHARE] = [1, 0.2];

export interface MeasureEvents {
  /** The corners have changed. */
  change: { corners: readonly MeasureCorner[]; line: LineMeasure; area: AreaMeasure };
  /** The face at the single corner is known; null when the surface there is not flat. */
  face: { face: Face | null };
  /** The heights along the line are known. */
  profile: { profile: Profile };
}

/**
 * Measures on the surface. Each click adds a corner; Backspace removes the last one, Escape all. Positions are read from the deepest level, whatever level
 * is shown.
 */
export class Measure extends MapLayer<Map3D, MeasureEvents> {
  readonly options: Required<Omit<MeasureOptions, "language">> & Pick<MeasureOptions, "language">;
  #messages = new MeasureMessages(undefined);
  readonly #overlay = new MeasureOverlay();
  readonly #chart = new ProfileChart((at) => this.#onCursorMove(at));
  #corners: readonly MeasureCorner[] = [];
  #profile: Profile | null = null;
  #face: Face | null = null;
  #direction = "";
  #abortReading = new AbortController();

  constructor({ kind = "line", ...options }: MeasureOptions = {}) {
    super();
    this.options = { kind, ...options };
  }

  /** Corners in the order of clicks. */
  get corners(): readonly MeasureCorner[] {
    return this.#corners;
  }

  /** Measurements of the line through the corners. */
  get line(): LineMeasure {
    return measureLine(this.#points());
  }

  /** Measurements of the polygon of the corners; zeros for fewer than three. */
  get area(): AreaMeasure {
    return measureArea(this.#points());
  }

  /** Heights along the line; null until they are known, and for other kinds. */
  get profile(): Profile | null {
    return this.#profile;
  }

  /** The face at the single corner, for the kind "area"; null until it is known, and when the surface is not flat. */
  get face(): Face | null {
    return this.#face;
  }

  /** What is measured, as labels and values in the user's language; empty until there are enough corners. */
  get results(): readonly (readonly [label: string, value: string])[] {
    const {
      options: { kind },
      line,
      area,
    } = this;
    const count = this.#corners.length;
    if (kind === "profile")
      return this.#profile ? this.#messages.describeProfile(line.horizontal_m, this.#profile.heights_m, this.#profile.approximate) : [];
    const prefix = this.#prefix();
    if (kind !== "area") return count < 2 ? [] : this.#messages.describeLine(line, kind === "height", prefix);
    if (this.#face)
      return this.#messages.describeArea(this.#face, `${this.#face.approximate ? "≈ " : prefix}${this.#face.hidden ? "≥ " : ""}`);
    return count < 3 ? [] : this.#messages.describeArea(area, prefix);
  }

  /** What makes the results doubtful, in the user's language: a height between points that are not one above the other, a point that fell past an edge. */
  get warnings(): readonly string[] {
    const { horizontal_m, rise_m } = this.line;
    const isOff = this.options.kind === "height" && horizontal_m > Math.max(PLUMB_M, PLUMB_SHARE * Math.abs(rise_m));
    const isPast = this.#corners.some(({ pastEdge }) => pastEdge);
    return [...(isOff ? [this.#messages.offPlumb] : []), ...(isPast ? [this.#messages.pastEdge] : [])];
  }

  /** Replaces all corners. */
  setCorners(corners: readonly MeasureCorner[]): this {
    [this.#corners, this.#face] = [corners, null];
    this.#draw();
    void this.#read();
    return this.fire("change", { corners, line: this.line, area: this.area });
  }

  /** Removes the last corner. */
  undo(): this {
    return this.setCorners(this.#corners.slice(0, -1));
  }

  /** Removes all corners. */
  clear(): this {
    return this.setCorners([]);
  }

  protected onAdd(map: Map3D): void {
    this.#messages = new MeasureMessages(this.options.language ?? map.language);
    adoptStyles(document, STYLES);
    map.overlayPane.append(this.#overlay.box);
    map.frameEvents.on("move", this.#updateOverlay);
    map.on("click", this.#onClick);
    map.container.addEventListener("keydown", this.#onKeyDown);
    this.#draw();
    map.on("moveend", this.#onMoveEnd);
    void this.#read();
  }

  protected onRemove(map: Map3D): void {
    map.frameEvents.off("move", this.#updateOverlay);
    map.off("click", this.#onClick);
    map.container.removeEventListener("keydown", this.#onKeyDown);
    map.off("moveend", this.#onMoveEnd);
    this.#abortReading.abort();
    this.#overlay.box.remove();
    this.#closeChart();
  }

  readonly #onClick = ({ position, approximate, point }: ClickEvent): void => {
    if (!position) return;
    const kept = this.options.kind === "height" && this.#corners.length > 1 ? [] : this.#corners;
    const corner = { position, approximate };
    this.setCorners([...kept, corner]);
    void this.#checkEdge(corner, point);
  };

  /** Marks the corner if something nearer ends beside the click. */
  async #checkEdge(corner: MeasureCorner, [x, y]: ClickEvent["point"]): Promise<void> {
    const { map } = this;
    const axes = map?.getViewState()?.camera.frame.axes;
    if (!map || !axes) return;
    const least_m = Math.max(EDGE_M, EDGE_SLOPE * EDGE_PX * map.metresPerPixel);
    const picks = await Promise.all(
      [0, 1, 2, 3, 4, 5, 6, 7].map((k) => map.pick([x + EDGE_PX * Math.cos((k * Math.PI) / 4), y + EDGE_PX * Math.sin((k * Math.PI) / 4)])),
    );
    const isNearer = picks.some(({ position }) => position && uvdFromLocal(axes, sub(corner.position, position))[2] > least_m);
    if (!isNearer || !this.#corners.includes(corner)) return;
    this.#corners = this.#corners.map((other) => (other === corner ? { ...corner, pastEdge: true } : other));
    this.fire("change", { corners: this.#corners, line: this.line, area: this.area });
  }

  readonly #onKeyDown = ({ key }: KeyboardEvent): void => {
    if (key === "Backspace") this.undo();
    else if (key === "Escape") this.clear();
  };

  /** Reads the profile again in another view, where other parts of the surface are visible. */
  readonly #onMoveEnd = (): void => {
    const direction = this.map?.direction ?? "";
    if (this.options.kind === "profile" && direction !== this.#direction) void this.#read();
  };

  /** Reads the heights along the line, or the face at the single corner. */
  async #read(): Promise<void> {
    this.#abortReading.abort();
    [this.#profile, this.#face] = [null, null];
    const {
      map,
      options: { kind },
    } = this;
    const count = this.#corners.length;
    const { signal } = (this.#abortReading = new AbortController());
    if (kind !== "profile" || count < 2) this.#closeChart();
    if (!map) return;
    this.#direction = map.direction;
    const reading =
      kind === "profile" && count > 1
        ? this.#readProfile(map, signal)
        : kind === "area" && count === 1
          ? this.#readFace(map, signal)
          : null;
    await reading?.catch((reason: unknown) => {
      if (!signal.aborted) map.layerContext?.report(asError(reason));
    });
  }

  async #readFace(map: Map3D, signal: AbortSignal): Promise<void> {
    const face = await measureFace(map, this.#points()[0] as Vec3, { signal });
    if (signal.aborted) return;
    this.#face = face;
    this.#draw();
    this.fire("face", { face });
  }

  async #readProfile(map: Map3D, signal: AbortSignal): Promise<void> {
    const profile = await measureProfile(map, this.#points(), { signal });
    if (signal.aborted) return;
    this.#profile = profile;
    const samples = samplePoints(this.#points(), profile.heights_m.length);
    this.#overlay.setCourse(
      samples.map(({ position: [x, y] }, k) => (Number.isNaN(profile.heights_m[k]) ? null : [x, y, profile.heights_m[k] as number])),
    );
    this.#updateOverlay();
    this.#chart.set(profile, this.#messages, profile.approximate ? "≈ " : "");
    map.overlayPane.append(this.#chart.box);
    this.fire("profile", { profile });
  }

  /** Removes the chart and the mark of its cursor. */
  #closeChart(): void {
    this.#chart.box.remove();
    this.#overlay.mark(null);
  }

  /** Marks the position of the chart's cursor on the map. */
  #onCursorMove(at: number | null): void {
    const { heights_m } = this.#profile ?? {};
    const height = at === null ? NaN : (heights_m?.[at] ?? NaN);
    const { position } = (at !== null && heights_m && samplePoints(this.#points(), heights_m.length)[at]) || {};
    this.#overlay.mark(position && !Number.isNaN(height) ? [position[0], position[1], height] : null);
    this.#updateOverlay();
  }

  #points(): Vec3[] {
    return this.#corners.map(({ position }) => position);
  }

  readonly #updateOverlay = (): void => this.#overlay.update((world) => this.map?.project(world) ?? null);

  #draw(): void {
    const points = this.#points();
    const { kind } = this.options;
    this.#overlay.set(points, kind === "area", kind === "area" ? this.#areaLabels(points) : this.#lineLabels(points));
    const [from, to] = points;
    // A plumb line from the lower point, then a level line.
    if (kind === "height" && from && to)
      this.#overlay.setCourse(from[2] < to[2] ? [from, [from[0], from[1], to[2]], to] : [to, [to[0], to[1], from[2]], from]);
    if (this.#face) this.#overlay.setCourse(this.#face.outline.flatMap((loop) => [...loop, loop[0] as Vec3, null]));
    this.#updateOverlay();
  }

  #lineLabels(points: readonly Vec3[]): MeasureLabel[] {
    const last = points.at(-1);
    if (!last || points.length < 2) return [];
    const { length_m, rise_m, steps_m } = this.line;
    const steps =
      steps_m.length < 2
        ? []
        : steps_m.map((step, k) => ({ at: mix(points[k] as Vec3, points[k + 1] as Vec3), text: this.#messages.length(step), main: false }));
    const length = this.options.kind === "height" ? "" : `${this.#messages.length(length_m)}  `;
    return [...steps, { at: last, text: `${this.#prefix()}${length}${this.#messages.rise(rise_m)}`, main: true }];
  }

  #areaLabels(points: readonly Vec3[]): MeasureLabel[] {
    const [first] = points;
    if (this.#face && first) return [{ at: first, text: this.#areaText(this.#face, this.#face), main: true }];
    if (points.length < 3) return [];
    const middle = points.reduce<Vec3>((sum, point) => mix(sum, point, 1 / points.length, 1), [0, 0, 0]);
    return [{ at: middle, text: this.#areaText(this.area, {}), main: true }];
  }

  #areaText(
    { area_m2, slope_deg }: Pick<AreaMeasure, "area_m2" | "slope_deg">,
    { hidden = false, approximate = false }: Partial<Face>,
  ): string {
    return `${approximate ? "≈ " : this.#prefix()}${hidden ? "≥ " : ""}${this.#messages.area(area_m2)}  ∠ ${slope_deg.toFixed(0)}°`;
  }

  /** Prefix of approximate numbers. */
  #prefix(): string {
    return this.#corners.some(({ approximate }) => approximate) ? "≈ " : "";
  }
}

const mix = (a: Vec3, b: Vec3, share = 0.5, rest = 1 - share): Vec3 => [
  a[0] * rest + b[0] * share,
  a[1] * rest + b[1] * share,
  a[2] * rest + b[2] * share,
];

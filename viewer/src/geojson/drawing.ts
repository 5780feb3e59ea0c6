import { element } from "../core/dom";
import type { Vec2 } from "../core/vec";
import type { Relief } from "../map3d";
import { filledSquare, meet, type Filling } from "./fills";
import { BEHIND, same, within, type Line, type Occlusion, type Placed } from "./placed";
import type { Rect, Run } from "./runs";

/** Of work on one frame, ms; the rest is done in the next. */
const WORK_MS = 12;
/** What is computed around the screen, in screens. */
const MARGIN = 0.25;
/** Gaps of what is hidden. */
const HIDDEN_DASH = [2, 5];

/** Filled pixels of a tile's square. */
interface Square {
  readonly rect: Rect;
  readonly level: number;
  readonly sources: readonly unknown[];
  /** null: nothing is in it. */
  readonly picture: HTMLCanvasElement | null;
}

/** Features on a canvas over the picture. Everything is kept in U and V, so that it goes with the picture while that moves; what has changed is computed bit by bit. */
export class Drawing {
  readonly canvas = element("canvas", "map3d-geojson", { "aria-hidden": "true" });
  occlusion: Occlusion = "fade";
  #chosen: Placed | null = null;
  #placed: readonly Placed[] = [];
  #fillings: Filling[] = [];
  #squares = new Map<string, Square>();
  #turned = "";
  /** What has been looked through: the view, and something around it. */
  #region: Rect | null = null;
  #level = NaN;
  #sources: readonly unknown[] = [];
  #drawn: Relief["camera"] | null = null;
  #stale: { update(relief: Relief, region: Rect, occlusion: Occlusion): void }[] = [];
  #missing: string[] = [];

  set(placed: readonly Placed[]): void {
    this.#placed = placed;
    this.#turned = "";
  }

  /** Styles, or what is shown, have changed. */
  restyle(): void {
    for (const { lines, spots } of this.#placed) for (const kept of [...lines, ...spots]) kept.forget();
    this.#fillings = this.#placed.flatMap(({ polygons, style }) => polygons.flatMap((polygon) => polygon.filling(style, this.occlusion) ?? []));
    this.#squares = new Map([...this.#squares].map(([key, square]) => [key, { ...square, sources: [null] }]));
    this.#region = null;
    this.#drawn = null;
  }

  /** A feature that is drawn with more weight. */
  choose(placed: Placed | null): void {
    [this.#chosen, this.#drawn] = [placed, null];
  }

  /** Draws a frame. @returns true when nothing is left to compute */
  frame(relief: Relief): boolean {
    const view = viewOf(relief);
    this.#turn(relief);
    const region = this.#look(relief, view);
    const end = performance.now() + WORK_MS;
    if (this.#stale.length + this.#missing.length > 0) this.#drawn = null;
    do this.#stale.shift()?.update(relief, region, this.occlusion);
    while (this.#stale.length > 0 && performance.now() < end);
    while (this.#missing.length > 0 && performance.now() < end) this.#fill(relief, this.#missing.shift() as string);
    if (relief.camera !== this.#drawn) this.#draw(relief, view);
    this.#drawn = relief.camera;
    const done = this.#stale.length + this.#missing.length === 0;
    if (done) this.#drop(relief, region);
    return done;
  }

  /** Another view or other heights: nothing that is known counts. */
  #turn(relief: Relief): void {
    const turned = [relief.camera.frame.id, ...relief.heights, ...relief.origin].join(" ");
    if (turned === this.#turned) return;
    this.#turned = turned;
    this.#squares.clear();
    for (const { lines, polygons, spots } of this.#placed) for (const part of [...lines, ...polygons, ...spots]) part.turn(relief);
    this.restyle();
  }

  /** Finds what is to be computed when something has changed, in what region. */
  #look(relief: Relief, view: Rect): Rect {
    const known = this.#region && relief.level === this.#level && within(view, this.#region) && same(this.#sources, relief.sources(this.#region));
    if (known && this.#region) return this.#region;
    const region = grown(view);
    [this.#region, this.#level, this.#sources] = [region, relief.level, relief.sources(region)];
    this.#stale = this.#placed.flatMap(({ lines, spots }) => [...lines, ...spots].filter((part) => part.stale(relief, region)));
    const keys = this.#fillings.length === 0 ? [] : [...new Set([...squaresIn(relief, view), ...squaresIn(relief, region)])];
    this.#missing = keys.filter((key) => {
      const square = this.#squares.get(key);
      return !square || !same(square.sources, relief.sources(square.rect));
    });
    return region;
  }

  #fill(relief: Relief, key: string): void {
    const { tilePx } = relief.camera.frame;
    const rect = rectOf(relief, key);
    const rgba = filledSquare(relief, [rect[0][0], rect[1][1]], tilePx, this.#fillings);
    const picture = rgba && element("canvas", "", { width: String(tilePx), height: String(tilePx) });
    if (rgba) picture?.getContext("2d")?.putImageData(new ImageData(rgba, tilePx, tilePx), 0, 0);
    this.#squares.set(key, { rect, level: relief.level, sources: relief.sources(rect), picture });
  }

  /** Lets go of what is far away, or of another level. */
  #drop(relief: Relief, region: Rect): void {
    const near = grown(region);
    for (const [key, { rect, level }] of this.#squares) if (level !== relief.level || !meet(rect, near)) this.#squares.delete(key);
  }

  #draw(relief: Relief, view: Rect): void {
    const { camera, dpr } = relief;
    const [width, height] = [Math.max(1, Math.round(camera.width * dpr)), Math.max(1, Math.round(camera.height * dpr))];
    if (this.canvas.width !== width || this.canvas.height !== height) [this.canvas.width, this.canvas.height] = [width, height];
    const context = this.canvas.getContext("2d");
    if (!context) return;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, width, height);
    const scale = width / (view[1][0] - view[0][0]);
    const at = (u: number, v: number): Vec2 => [(u - view[0][0]) * scale, (view[1][1] - v) * scale];
    this.#drawSquares(context, relief, view, at);
    for (const placed of this.#placed) for (const line of placed.lines) if (line.reach && meet(line.reach, view)) this.#drawLine(context, placed, line, at, dpr);
    for (const placed of this.#placed) this.#drawSpots(context, placed, at, dpr);
  }

  #drawSquares(context: CanvasRenderingContext2D, relief: Relief, view: Rect, at: (u: number, v: number) => Vec2): void {
    if (this.#fillings.length === 0) return;
    context.imageSmoothingEnabled = false;
    const place = ([low, high]: Rect): [number, number, number, number] => {
      const [x0, y0, x1, y1] = [...at(low[0], high[1]), ...at(high[0], low[1])].map(Math.round) as [number, number, number, number];
      return [x0, y0, x1 - x0, y1 - y0];
    };
    for (const key of squaresIn(relief, view)) {
      const square = this.#squares.get(key);
      if (square?.picture) context.drawImage(square.picture, ...place(square.rect));
      if (square) continue;
      // Until it is filled, those of the level before stand in.
      const rect = rectOf(relief, key);
      context.save();
      context.beginPath();
      context.rect(...place(rect));
      context.clip();
      for (const other of this.#squares.values()) if (other.picture && other.level !== relief.level && meet(other.rect, rect)) context.drawImage(other.picture, ...place(other.rect));
      context.restore();
    }
  }

  #drawLine(context: CanvasRenderingContext2D, placed: Placed, { runs }: Line, at: (u: number, v: number) => Vec2, dpr: number): void {
    const { style } = placed;
    const width = (style.width + (placed === this.#chosen ? 2 : 0)) * dpr;
    if (style.width === 0) return;
    const [seen, hidden] = [false, true].map((behind) => pathOf(runs.filter((run) => run.hidden === behind), at)) as [Path2D, Path2D];
    [context.lineJoin, context.lineCap, context.strokeStyle] = ["round", "round", style.color];
    if (this.occlusion !== "hide") {
      context.globalAlpha = style.opacity * (BEHIND[this.occlusion] + 0.2);
      context.lineWidth = Math.max(width * 0.6, dpr);
      context.setLineDash(HIDDEN_DASH.map((length) => length * dpr));
      context.stroke(hidden);
    }
    context.setLineDash([]);
    context.globalAlpha = style.opacity;
    if (style.halo !== null) {
      [context.strokeStyle, context.lineWidth] = [style.halo, width + 3 * dpr];
      context.stroke(seen);
    }
    [context.strokeStyle, context.lineWidth] = [style.color, width];
    if (style.dash.length > 0) context.lineCap = "butt";
    context.setLineDash(style.dash.map((length) => length * dpr));
    context.stroke(seen);
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  #drawSpots(context: CanvasRenderingContext2D, placed: Placed, at: (u: number, v: number) => Vec2, dpr: number): void {
    const { style, spots } = placed;
    const radius = (style.radius + (placed === this.#chosen ? 2 : 0)) * dpr;
    for (const spot of spots) {
      if (!spot.at || (spot.hidden && this.occlusion === "hide")) continue;
      const [x, y] = at(spot.at[0], spot.at[1]);
      if (x < -radius || y < -radius || x > this.canvas.width + radius || y > this.canvas.height + radius) continue;
      context.globalAlpha = style.opacity * (spot.hidden ? BEHIND[this.occlusion] : 1);
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.fillStyle = style.color;
      context.fill();
      [context.strokeStyle, context.lineWidth] = ["#fff", 2 * dpr];
      context.stroke();
    }
    context.globalAlpha = 1;
  }
}

function pathOf(runs: readonly Run[], at: (u: number, v: number) => Vec2): Path2D {
  const path = new Path2D();
  for (const { uv } of runs) {
    for (let k = 0; k < uv.length; k += 2) {
      const [x, y] = at(uv[k] as number, uv[k + 1] as number);
      if (k === 0) path.moveTo(x, y);
      else path.lineTo(x, y);
    }
  }
  return path;
}

/** What the screen shows. */
export function viewOf({ camera, pixel_m, level }: Relief): Rect {
  const px = (pixel_m * 2 ** level) / 2 ** camera.zoom;
  const [w, h] = [(camera.width / 2) * px, (camera.height / 2) * px];
  return [[camera.u - w, camera.v - h], [camera.u + w, camera.v + h]];
}

function grown([low, high]: Rect): Rect {
  const [w, h] = [(high[0] - low[0]) * MARGIN, (high[1] - low[1]) * MARGIN];
  return [[low[0] - w, low[1] - h], [high[0] + w, high[1] + h]];
}

/** Squares of the frame's tiles, and of such beyond it, that meet a rectangle. */
function squaresIn({ camera: { frame }, pixel_m, level }: Relief, [low, high]: Rect): string[] {
  const side = frame.tilePx * pixel_m;
  const keys: string[] = [];
  for (let y = Math.floor((frame.v0 - high[1]) / side); y < (frame.v0 - low[1]) / side; y++) {
    for (let x = Math.floor((low[0] - frame.u0) / side); x < (high[0] - frame.u0) / side; x++) keys.push(`${String(level)}/${String(x)}/${String(y)}`);
  }
  return keys;
}

function rectOf({ camera: { frame }, pixel_m }: Relief, key: string): Rect {
  const [, x = 0, y = 0] = key.split("/").map(Number);
  const side = frame.tilePx * pixel_m;
  return [[frame.u0 + x * side, frame.v0 - (y + 1) * side], [frame.u0 + (x + 1) * side, frame.v0 - y * side]];
}

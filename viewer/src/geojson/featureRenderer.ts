import { element } from "../core/dom";
import type { Vec2 } from "../core/vec";
import type { VisibleDepths } from "../map3d";
import { fillTile, overlaps, type PolygonFill } from "./fills";
import { OPACITY_BEHIND, same, within, type FeatureLine, type Occlusion, type PlacedFeature } from "./placedFeature";
import type { UvRect, LineSection } from "./lineSections";

/** Time budget per frame, ms; the next frames do the rest. */
const BUDGET_MS = 12;
/** Margin around the screen that is computed, too, in screens. */
const MARGIN = 0.25;
/** Dash pattern of hidden lines, CSS pixels. */
const HIDDEN_DASH = [2, 5];

/** Filled pixels of one tile. */
interface FillTile {
  readonly rect: UvRect;
  readonly level: number;
  readonly sources: readonly unknown[];
  /** null for an empty tile. */
  readonly image: HTMLCanvasElement | null;
}

/** Draws features on a canvas over the map. All results are kept in U and V, so that they follow the map while it moves. Changes are computed incrementally. */
export class FeatureRenderer {
  readonly canvas = element("canvas", "map3d-geojson", { "aria-hidden": "true" });
  occlusion: Occlusion = "fade";
  #focused: PlacedFeature | null = null;
  #placed: readonly PlacedFeature[] = [];
  #fills: PolygonFill[] = [];
  #tiles = new Map<string, FillTile>();
  #viewKey = "";
  /** The computed region: the screen and a margin. */
  #region: UvRect | null = null;
  #level = NaN;
  #sources: readonly unknown[] = [];
  #drawnCamera: VisibleDepths["camera"] | null = null;
  #stale: { update(relief: VisibleDepths, region: UvRect, occlusion: Occlusion): void }[] = [];
  #missing: string[] = [];

  set(placed: readonly PlacedFeature[]): void {
    this.#placed = placed;
    this.#viewKey = "";
  }

  /** Discards what depends on styles. */
  restyle(): void {
    for (const { lines, dots } of this.#placed) for (const cached of [...lines, ...dots]) cached.invalidate();
    this.#fills = this.#placed.flatMap(({ polygons, style }) => polygons.flatMap((polygon) => polygon.fillIn(style, this.occlusion) ?? []));
    this.#tiles = new Map([...this.#tiles].map(([key, tile]) => [key, { ...tile, sources: [null] }]));
    this.#region = null;
    this.#drawnCamera = null;
  }

  /** Emphasises a feature. */
  setFocus(placed: PlacedFeature | null): void {
    [this.#focused, this.#drawnCamera] = [placed, null];
  }

  /** Draws a frame. @returns true when all results are computed */
  frame(relief: VisibleDepths): boolean {
    const view = screenRect(relief);
    this.#updateView(relief);
    const region = this.#findWork(relief, view);
    const end = performance.now() + BUDGET_MS;
    if (this.#stale.length + this.#missing.length > 0) this.#drawnCamera = null;
    do this.#stale.shift()?.update(relief, region, this.occlusion);
    while (this.#stale.length > 0 && performance.now() < end);
    while (this.#missing.length > 0 && performance.now() < end) this.#fill(relief, this.#missing.shift() as string);
    if (relief.camera !== this.#drawnCamera) this.#draw(relief, view);
    this.#drawnCamera = relief.camera;
    const done = this.#stale.length + this.#missing.length === 0;
    if (done) this.#evict(relief, region);
    return done;
  }

  /** Discards all results when the view or the height range changes. */
  #updateView(relief: VisibleDepths): void {
    const viewKey = [relief.camera.frame.id, ...relief.heights, ...relief.origin].join(" ");
    if (viewKey === this.#viewKey) return;
    this.#viewKey = viewKey;
    this.#tiles.clear();
    for (const { lines, polygons, dots } of this.#placed) for (const part of [...lines, ...polygons, ...dots]) part.setView(relief);
    this.restyle();
  }

  /** Lists the work required after a change. @returns the region to compute */
  #findWork(relief: VisibleDepths, view: UvRect): UvRect {
    const current =
      this.#region && relief.level === this.#level && within(view, this.#region) && same(this.#sources, relief.sources(this.#region));
    if (current && this.#region) return this.#region;
    const region = withMargin(view);
    [this.#region, this.#level, this.#sources] = [region, relief.level, relief.sources(region)];
    this.#stale = this.#placed.flatMap(({ lines, dots }) => [...lines, ...dots].filter((part) => part.isStale(relief, region)));
    const keys = this.#fills.length === 0 ? [] : [...new Set([...tilesIn(relief, view), ...tilesIn(relief, region)])];
    this.#missing = keys.filter((key) => {
      const tile = this.#tiles.get(key);
      return !tile || !same(tile.sources, relief.sources(tile.rect));
    });
    return region;
  }

  #fill(relief: VisibleDepths, key: string): void {
    const { tilePx } = relief.camera.frame;
    const rect = rectOf(relief, key);
    const rgba = fillTile(relief, [rect[0][0], rect[1][1]], tilePx, this.#fills);
    const image = rgba && element("canvas", "", { width: String(tilePx), height: String(tilePx) });
    if (rgba) image?.getContext("2d")?.putImageData(new ImageData(rgba, tilePx, tilePx), 0, 0);
    this.#tiles.set(key, { rect, level: relief.level, sources: relief.sources(rect), image });
  }

  /** Drops tiles that are far away or of another level. */
  #evict(relief: VisibleDepths, region: UvRect): void {
    const near = withMargin(region);
    for (const [key, { rect, level }] of this.#tiles) if (level !== relief.level || !overlaps(rect, near)) this.#tiles.delete(key);
  }

  #draw(relief: VisibleDepths, view: UvRect): void {
    const { camera, dpr } = relief;
    const [width, height] = [Math.max(1, Math.round(camera.width * dpr)), Math.max(1, Math.round(camera.height * dpr))];
    if (this.canvas.width !== width || this.canvas.height !== height) [this.canvas.width, this.canvas.height] = [width, height];
    const context = this.canvas.getContext("2d");
    if (!context) return;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, width, height);
    const scale = width / (view[1][0] - view[0][0]);
    const at = (u: number, v: number): Vec2 => [(u - view[0][0]) * scale, (view[1][1] - v) * scale];
    this.#drawTiles(context, relief, view, at);
    for (const placed of this.#placed)
      for (const line of placed.lines) if (line.reach && overlaps(line.reach, view)) this.#drawLine(context, placed, line, at, dpr);
    for (const placed of this.#placed) this.#drawDots(context, placed, at, dpr);
  }

  #drawTiles(context: CanvasRenderingContext2D, relief: VisibleDepths, view: UvRect, at: (u: number, v: number) => Vec2): void {
    if (this.#fills.length === 0) return;
    context.imageSmoothingEnabled = false;
    const toScreen = ([low, high]: UvRect): [number, number, number, number] => {
      const [x0, y0, x1, y1] = [...at(low[0], high[1]), ...at(high[0], low[1])].map(Math.round) as [number, number, number, number];
      return [x0, y0, x1 - x0, y1 - y0];
    };
    for (const key of tilesIn(relief, view)) {
      const tile = this.#tiles.get(key);
      if (tile?.image) context.drawImage(tile.image, ...toScreen(tile.rect));
      if (tile) continue;
      // Until the tile is filled, tiles of the previous level replace it.
      const rect = rectOf(relief, key);
      context.save();
      context.beginPath();
      context.rect(...toScreen(rect));
      context.clip();
      for (const other of this.#tiles.values())
        if (other.image && other.level !== relief.level && overlaps(other.rect, rect))
          context.drawImage(other.image, ...toScreen(other.rect));
      context.restore();
    }
  }

  #drawLine(
    context: CanvasRenderingContext2D,
    placed: PlacedFeature,
    { sections }: FeatureLine,
    at: (u: number, v: number) => Vec2,
    dpr: number,
  ): void {
    const { style } = placed;
    const width = (style.width + (placed === this.#focused ? 2 : 0)) * dpr;
    if (style.width === 0) return;
    const [visible, hidden] = [false, true].map((behind) =>
      pathOf(
        sections.filter((section) => section.hidden === behind),
        at,
      ),
    ) as [Path2D, Path2D];
    [context.lineJoin, context.lineCap, context.strokeStyle] = ["round", "round", style.color];
    if (this.occlusion !== "hide") {
      context.globalAlpha = style.opacity * (OPACITY_BEHIND[this.occlusion] + 0.2);
      context.lineWidth = Math.max(width * 0.6, dpr);
      context.setLineDash(HIDDEN_DASH.map((length) => length * dpr));
      context.stroke(hidden);
    }
    context.setLineDash([]);
    context.globalAlpha = style.opacity;
    if (style.halo !== null) {
      [context.strokeStyle, context.lineWidth] = [style.halo, width + 3 * dpr];
      context.stroke(visible);
    }
    [context.strokeStyle, context.lineWidth] = [style.color, width];
    if (style.dash.length > 0) context.lineCap = "butt";
    context.setLineDash(style.dash.map((length) => length * dpr));
    context.stroke(visible);
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  #drawDots(context: CanvasRenderingContext2D, placed: PlacedFeature, at: (u: number, v: number) => Vec2, dpr: number): void {
    const { style, dots } = placed;
    const radius = (style.radius + (placed === this.#focused ? 2 : 0)) * dpr;
    for (const dot of dots) {
      if (!dot.at || (dot.hidden && this.occlusion === "hide")) continue;
      const [x, y] = at(dot.at[0], dot.at[1]);
      if (x < -radius || y < -radius || x > this.canvas.width + radius || y > this.canvas.height + radius) continue;
      context.globalAlpha = style.opacity * (dot.hidden ? OPACITY_BEHIND[this.occlusion] : 1);
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

function pathOf(sections: readonly LineSection[], at: (u: number, v: number) => Vec2): Path2D {
  const path = new Path2D();
  for (const { uv } of sections) {
    for (let k = 0; k < uv.length; k += 2) {
      const [x, y] = at(uv[k] as number, uv[k + 1] as number);
      if (k === 0) path.moveTo(x, y);
      else path.lineTo(x, y);
    }
  }
  return path;
}

/** Returns the rectangle in U and V that the screen shows. */
export function screenRect({ camera, pixel_m, level }: VisibleDepths): UvRect {
  const px = (pixel_m * 2 ** level) / 2 ** camera.zoom;
  const [w, h] = [(camera.width / 2) * px, (camera.height / 2) * px];
  return [
    [camera.u - w, camera.v - h],
    [camera.u + w, camera.v + h],
  ];
}

function withMargin([low, high]: UvRect): UvRect {
  const [w, h] = [(high[0] - low[0]) * MARGIN, (high[1] - low[1]) * MARGIN];
  return [
    [low[0] - w, low[1] - h],
    [high[0] + w, high[1] + h],
  ];
}

/** Keys of the tiles that overlap a rectangle; the tile grid extends beyond the frame. */
function tilesIn({ camera: { frame }, pixel_m, level }: VisibleDepths, [low, high]: UvRect): string[] {
  const side = frame.tilePx * pixel_m;
  const keys: string[] = [];
  for (let y = Math.floor((frame.v0 - high[1]) / side); y < (frame.v0 - low[1]) / side; y++) {
    for (let x = Math.floor((low[0] - frame.u0) / side); x < (high[0] - frame.u0) / side; x++)
      keys.push(`${String(level)}/${String(x)}/${String(y)}`);
  }
  return keys;
}

function rectOf({ camera: { frame }, pixel_m }: VisibleDepths, key: string): UvRect {
  const [, x = 0, y = 0] = key.split("/").map(Number);
  const side = frame.tilePx * pixel_m;
  return [
    [frame.u0 + x * side, frame.v0 - (y + 1) * side],
    [frame.u0 + (x + 1) * side, frame.v0 - y * side],
  ];
}

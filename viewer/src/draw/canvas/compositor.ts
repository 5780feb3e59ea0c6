import { element } from "../../core/dom";
import type { Clip } from "../depthMapping";
import type { FrameState } from "../drawer";
import { getContext2d, TileMosaic, type Grid, type MosaicTile } from "./tileMosaic";

/** The tiles of a pass, ready to be composed. */
export interface ComposedPass {
  readonly grid: Grid;
  readonly tiles: readonly MosaicTile[];
  readonly smooth: boolean;
  readonly opacity: number;
  readonly clip: Clip | null;
}

/** Shows the passes of a frame. */
export interface Compositor {
  /** The element that shows them. */
  readonly element: HTMLElement;
  /** Shows all passes of a frame, the lowest first. */
  show(screen: FrameState, passes: readonly ComposedPass[]): void;
  remove(): void;
}

/** Draws passes on a canvas, whose pixels can be read. */
export class CanvasCompositor implements Compositor {
  readonly #context: CanvasRenderingContext2D;
  readonly #mosaic = new TileMosaic();
  readonly #listeners = new AbortController();

  /** @param lost called when the browser has lost the content  @throws DrawError */
  constructor(canvas: HTMLCanvasElement, lost: () => void) {
    this.#context = getContext2d(canvas);
    for (const each of [canvas, this.#mosaic.canvas])
      each.addEventListener(
        "contextrestored",
        () => {
          this.#mosaic.invalidate();
          lost();
        },
        { signal: this.#listeners.signal },
      );
  }

  get element(): HTMLElement {
    return this.#context.canvas;
  }

  show(screen: FrameState, passes: readonly ComposedPass[]): void {
    this.#context.clearRect(0, 0, screen.width, screen.height);
    for (const pass of passes) {
      this.#context.save();
      this.#paint(screen, pass);
      this.#context.restore();
    }
  }

  remove(): void {
    this.#listeners.abort();
    this.#mosaic.empty();
  }

  #paint(screen: FrameState, { grid, tiles, smooth, opacity, clip }: ComposedPass): void {
    const window = this.#mosaic.update(screen, grid, tiles, smooth, 0);
    if (!window) return;
    const [[x0, y0, x1, y1], { left, top, px }, context] = [window, grid, this.#context];
    if (clip) {
      const [x, y, right, bottom] = computeClip(clip, screen);
      context.beginPath();
      context.rect(x, y, right - x, bottom - y);
      context.clip();
    }
    context.imageSmoothingEnabled = smooth && px !== 1;
    context.globalAlpha = opacity;
    context.drawImage(this.#mosaic.canvas, 0, 0, x1 - x0, y1 - y0, left + x0 * px, top + y0 * px, (x1 - x0) * px, (y1 - y0) * px);
  }
}

/** Margin of level pixels around the visible window, ready for movements. */
const MARGIN_PX = 64;

/** Shields the elements from the page's styles for canvases and blocks (widths, margins, borders). */
const RESET_CSS = "all:initial;position:absolute;pointer-events:none;";

function makeBlock(name: string): HTMLElement {
  const made = element("div", name, { "aria-hidden": "true" });
  made.style.cssText = `${RESET_CSS}inset:0;overflow:hidden`;
  return made;
}

/** Places mosaics as elements below the canvas: the browser moves and scales unchanged ones, which takes a quarter of the work of drawing, and needs memory for the level's pixels only. */
export class CssCompositor implements Compositor {
  readonly element = makeBlock("map3d-mosaics");
  readonly #lost: () => void;
  readonly #layers: { readonly box: HTMLElement; readonly mosaic: TileMosaic }[] = [];

  /** @param lost called when the browser has lost the content  @throws DrawError */
  constructor(canvas: HTMLCanvasElement, lost: () => void) {
    this.#lost = lost;
    this.#getLayer(0);
    const { borderRadius, filter } = getComputedStyle(canvas);
    Object.assign(this.element.style, { borderRadius, filter });
    canvas.before(this.element);
  }

  show(screen: FrameState, passes: readonly ComposedPass[]): void {
    passes.forEach((pass, k) => this.#show(screen, pass, this.#getLayer(k)));
    for (const { box, mosaic } of this.#layers.splice(passes.length)) {
      box.remove();
      mosaic.empty();
    }
  }

  remove(): void {
    this.element.remove();
    for (const { mosaic } of this.#layers) mosaic.empty();
  }

  #show(
    screen: FrameState,
    { grid, tiles, smooth, opacity, clip }: ComposedPass,
    { box, mosaic }: { box: HTMLElement; mosaic: TileMosaic },
  ): void {
    const [x, y] = mosaic.update(screen, grid, tiles, smooth, MARGIN_PX) ?? [0, 0];
    const [scale, css] = [grid.px / screen.dpr, (at: number): string => `${String(at / screen.dpr)}px`];
    const { canvas } = mosaic;
    Object.assign(canvas.style, {
      width: `${String(canvas.width)}px`,
      height: `${String(canvas.height)}px`,
      transform: `translate(${css(grid.left + x * grid.px)}, ${css(grid.top + y * grid.px)}) scale(${String(scale)})`,
      imageRendering: smooth ? "auto" : "pixelated",
    });
    const [left, top, right, bottom] = computeClip(clip ?? [0, 0, 1, 1], screen);
    Object.assign(box.style, {
      opacity: String(opacity),
      clipPath: clip ? `inset(${css(top)} ${css(screen.width - right)} ${css(screen.height - bottom)} ${css(left)})` : "",
    });
  }

  #getLayer(k: number): { box: HTMLElement; mosaic: TileMosaic } {
    const known = this.#layers[k];
    if (known) return known;
    const layer = { box: makeBlock(""), mosaic: new TileMosaic() };
    layer.mosaic.canvas.style.cssText = `${RESET_CSS}left:0;top:0;transform-origin:0 0;will-change:transform`;
    layer.mosaic.canvas.addEventListener("contextrestored", () => {
      layer.mosaic.invalidate();
      this.#lost();
    });
    layer.box.append(layer.mosaic.canvas);
    this.element.append(layer.box);
    this.#layers.push(layer);
    return layer;
  }
}

/** Computes a clip in whole device pixels: left, top, right, bottom. */
function computeClip([left, top, right, bottom]: Clip, { width, height }: FrameState): [number, number, number, number] {
  return [Math.round(left * width), Math.round(top * height), Math.round(right * width), Math.round(bottom * height)];
}

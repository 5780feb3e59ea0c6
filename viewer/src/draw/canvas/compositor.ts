import { element } from "../../core/dom";
import type { Clip } from "../depthMapping";
import type { FrameState } from "../drawer";
import { getContext2d, TileMosaic, type Grid, type MosaicTile } from "./tileMosaic";

/** What a pass shows. */
export interface ComposedPass {
  readonly grid: Grid;
  readonly tiles: readonly MosaicTile[];
  readonly smooth: boolean;
  readonly opacity: number;
  readonly clip: Clip | null;
}

/** How passes come to be seen. */
export interface Compositor {
  /** What they are seen in. */
  readonly element: HTMLElement;
  /** All of a frame, the lowest first. */
  show(screen: FrameState, passes: readonly ComposedPass[]): void;
  remove(): void;
}

/** Painted on a canvas, whose pixels can be read. */
export class CanvasCompositor implements Compositor {
  readonly #context: CanvasRenderingContext2D;
  readonly #sheet = new TileMosaic();
  readonly #listeners = new AbortController();

  /** @param lost the browser has lost what was drawn  @throws DrawError */
  constructor(canvas: HTMLCanvasElement, lost: () => void) {
    this.#context = getContext2d(canvas);
    for (const each of [canvas, this.#sheet.canvas]) each.addEventListener("contextrestored", () => {
      this.#sheet.invalidate();
      lost();
    }, { signal: this.#listeners.signal });
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
    this.#sheet.empty();
  }

  #paint(screen: FrameState, { grid, tiles, smooth, opacity, clip }: ComposedPass): void {
    const window = this.#sheet.update(screen, grid, tiles, smooth, 0);
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
    context.drawImage(this.#sheet.canvas, 0, 0, x1 - x0, y1 - y0, left + x0 * px, top + y0 * px, (x1 - x0) * px, (y1 - y0) * px);
  }
}

/** Pixels of the level beyond what is seen that are there when the picture is moved. */
const MARGIN_PX = 64;

/** Page styles for any canvas or block (widths, margins, frames) must not reach what is so styled. */
const RESET_CSS = "all:initial;position:absolute;pointer-events:none;";

function makeBlock(name: string): HTMLElement {
  const made = element("div", name, { "aria-hidden": "true" });
  made.style.cssText = `${RESET_CSS}inset:0;overflow:hidden`;
  return made;
}

/** Elements of the page, below a canvas: the browser moves and scales what has not changed, which takes a quarter of the work that painting does, and memory for pixels of the level alone. */
export class CssCompositor implements Compositor {
  readonly element = makeBlock("map3d-mosaics");
  readonly #lost: () => void;
  readonly #layers: { readonly box: HTMLElement; readonly sheet: TileMosaic }[] = [];

  /** @param lost the browser has lost what was drawn  @throws DrawError */
  constructor(canvas: HTMLCanvasElement, lost: () => void) {
    this.#lost = lost;
    this.#getLayer(0);
    const { borderRadius, filter } = getComputedStyle(canvas);
    Object.assign(this.element.style, { borderRadius, filter });
    canvas.before(this.element);
  }

  show(screen: FrameState, passes: readonly ComposedPass[]): void {
    passes.forEach((pass, k) => { this.#show(screen, pass, this.#getLayer(k)); });
    for (const { box, sheet } of this.#layers.splice(passes.length)) {
      box.remove();
      sheet.empty();
    }
  }

  remove(): void {
    this.element.remove();
    for (const { sheet } of this.#layers) sheet.empty();
  }

  #show(screen: FrameState, { grid, tiles, smooth, opacity, clip }: ComposedPass, { box, sheet }: { box: HTMLElement; sheet: TileMosaic }): void {
    const [x, y] = sheet.update(screen, grid, tiles, smooth, MARGIN_PX) ?? [0, 0];
    const [scale, css] = [grid.px / screen.dpr, (at: number): string => `${String(at / screen.dpr)}px`];
    const { canvas } = sheet;
    Object.assign(canvas.style, { width: `${String(canvas.width)}px`, height: `${String(canvas.height)}px`, transform: `translate(${css(grid.left + x * grid.px)}, ${css(grid.top + y * grid.px)}) scale(${String(scale)})`, imageRendering: smooth ? "auto" : "pixelated" });
    const [left, top, right, bottom] = computeClip(clip ?? [0, 0, 1, 1], screen);
    Object.assign(box.style, { opacity: String(opacity), clipPath: clip ? `inset(${css(top)} ${css(screen.width - right)} ${css(screen.height - bottom)} ${css(left)})` : "" });
  }

  #getLayer(k: number): { box: HTMLElement; sheet: TileMosaic } {
    const known = this.#layers[k];
    if (known) return known;
    const place = { box: makeBlock(""), sheet: new TileMosaic() };
    place.sheet.canvas.style.cssText = `${RESET_CSS}left:0;top:0;transform-origin:0 0;will-change:transform`;
    place.sheet.canvas.addEventListener("contextrestored", () => {
      place.sheet.invalidate();
      this.#lost();
    });
    place.box.append(place.sheet.canvas);
    this.element.append(place.box);
    this.#layers.push(place);
    return place;
  }
}

/** Left, top, right, bottom in whole device pixels. */
function computeClip([left, top, right, bottom]: Clip, { width, height }: FrameState): [number, number, number, number] {
  return [Math.round(left * width), Math.round(top * height), Math.round(right * width), Math.round(bottom * height)];
}

import { element } from "../core/dom";
import { UsageError } from "../core/errors";

export interface Size {
  /** CSS pixels. */
  readonly width: number;
  readonly height: number;
  /** Device pixels a CSS pixel; not whole under browser zoom. */
  readonly dpr: number;
}

const LAYOUT_PROPERTIES = ["top", "right", "bottom", "left", "z-index", "flex-grow", "flex-shrink", "flex-basis", "align-self", "justify-self", "grid-area", "order"];

/** The map's place in the page: the canvas, wrapped in a container that takes the canvas's place in the layout. */
export class Viewport {
  readonly container: HTMLElement;
  readonly overlayPane = element("div", "map3d-overlay");
  readonly controlPane = element("div", "map3d-controls");
  readonly #observer: ResizeObserver;
  readonly #unwrap: (canvas: HTMLCanvasElement) => void;
  #canvas: HTMLCanvasElement;
  #size: Size;

  /** @param target a canvas or another element, or its id  @throws UsageError */
  constructor(target: string | HTMLElement, resized: () => void) {
    const found = typeof target === "string" ? document.getElementById(target) : target;
    if (!found) throw new UsageError(`no element has the id "${typeof target === "string" ? target : ""}"; give the id of a <canvas> that is in the page`);
    ({ container: this.container, canvas: this.#canvas, unwrap: this.#unwrap } = found instanceof HTMLCanvasElement ? wrapCanvas(found) : fillElement(found));
    this.container.append(this.overlayPane, this.controlPane);
    this.#size = this.#measure();
    this.#observer = new ResizeObserver(() => {
      this.#size = this.#measure();
      resized();
    });
    this.#observer.observe(this.#canvas);
  }

  get canvas(): HTMLCanvasElement {
    return this.#canvas;
  }

  get size(): Size {
    return this.#size;
  }

  /** Gives the canvas the device pixels it covers; changing them clears it, so only just before a frame. */
  fitCanvas(dpr: number): void {
    const { width, height } = this.#size;
    const [w, h] = [Math.max(1, Math.round(width * dpr)), Math.max(1, Math.round(height * dpr))];
    if (this.#canvas.width !== w) this.#canvas.width = w;
    if (this.#canvas.height !== h) this.#canvas.height = h;
  }

  /** Puts a fresh canvas, which can get any context, in the place of the one that is there. */
  replaceCanvas(): void {
    const fresh = this.#canvas.cloneNode(false) as HTMLCanvasElement;
    this.#observer.unobserve(this.#canvas);
    this.#canvas.replaceWith(fresh);
    this.#canvas = fresh;
    this.#observer.observe(fresh);
  }

  destroy(): void {
    this.#observer.disconnect();
    this.overlayPane.remove();
    this.controlPane.remove();
    this.#unwrap(this.#canvas);
  }

  #measure(): Size {
    return { width: this.#canvas.clientWidth, height: this.#canvas.clientHeight, dpr: window.devicePixelRatio || 1 };
  }
}

interface WrappedCanvas {
  container: HTMLElement;
  canvas: HTMLCanvasElement;
  /** Undoes it for the canvas that is there now. */
  unwrap: (canvas: HTMLCanvasElement) => void;
}

/**
 * Puts a container where the canvas was. A side that the page gives in per cent, or not at all, becomes the
 * container's; a side that it gives as a length (px, vh, …) stays the canvas's own, and the container follows.
 */
function wrapCanvas(canvas: HTMLCanvasElement): WrappedCanvas {
  const container = element("div", "map3d");
  const before = canvas.style.cssText;
  canvas.style.display = "none"; // so that computed sizes are those of the style sheet, not of the layout
  const style = getComputedStyle(canvas);
  const out = style.position === "absolute" || style.position === "fixed";
  container.style.position = out ? style.position : "relative";
  container.style.margin = style.margin;
  for (const name of LAYOUT_PROPERTIES) container.style.setProperty(name, style.getPropertyValue(name));
  const sides = (["width", "height"] as const).map((side) => [side, style[side]] as const);
  canvas.style.cssText = `${before};display:block;position:static;margin:0;`;
  for (const [side, value] of sides) sizeSide(container, canvas, side, value);
  canvas.replaceWith(container);
  container.append(canvas);
  const unwrap = (last: HTMLCanvasElement): void => {
    last.style.cssText = before;
    container.replaceWith(last);
  };
  return { container, canvas, unwrap };
}

function sizeSide(container: HTMLElement, canvas: HTMLCanvasElement, side: "width" | "height", value: string): void {
  const own = !value.includes("%") && value !== "auto";
  container.style[side] = own ? "fit-content" : value === "auto" ? `${String(canvas[side])}px` : value;
  if (!own) canvas.style[side] = "100%";
}

/** An element that is no canvas becomes the container itself. */
function fillElement(container: HTMLElement): WrappedCanvas {
  const canvas = element("canvas", "");
  canvas.style.cssText = "display:block;width:100%;height:100%";
  container.classList.add("map3d");
  if (getComputedStyle(container).position === "static") container.style.position = "relative";
  container.append(canvas);
  const unwrap = (last: HTMLCanvasElement): void => {
    last.remove();
    container.classList.remove("map3d");
  };
  return { container, canvas, unwrap };
}

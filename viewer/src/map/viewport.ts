import { element } from "../core/dom";
import { UsageError } from "../core/errors";

export interface Size {
  /** CSS pixels. */
  readonly width: number;
  readonly height: number;
  /** Device pixels per CSS pixel; fractional under browser zoom. */
  readonly dpr: number;
}

/** Containers of maps. */
const containers = new WeakSet<Element>();
const LAYOUT_PROPERTIES = [
  "top",
  "right",
  "bottom",
  "left",
  "z-index",
  "flex-grow",
  "flex-shrink",
  "flex-basis",
  "align-self",
  "justify-self",
  "grid-area",
  "order",
];

/** The map in the page: the canvas, wrapped in a container that replaces it in the layout. */
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
    const found = (typeof target === "string" ? document.getElementById(target) : target) as HTMLElement;
    if (!(found as Partial<Node> | null)?.nodeType)
      throw new UsageError(
        `${typeof target === "string" ? `no element has the id "${target}"` : "not an element"}; pass a <canvas> of the page, or its id`,
      );
    if (containers.has(found) || (found instanceof HTMLCanvasElement && found.parentElement && containers.has(found.parentElement)))
      throw new UsageError(`the element "${found.id}" has a map already; call its remove() first, or use another element`);
    ({
      container: this.container,
      canvas: this.#canvas,
      unwrap: this.#unwrap,
    } = found instanceof HTMLCanvasElement ? wrapCanvas(found) : fillElement(found));
    containers.add(this.container);
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

  /** Sets the canvas's size in device pixels, which clears it if it changes; call it just before a frame. */
  fitCanvas(dpr: number): void {
    const { width, height } = this.#size;
    const [w, h] = [Math.max(1, Math.round(width * dpr)), Math.max(1, Math.round(height * dpr))];
    if (this.#canvas.width !== w) this.#canvas.width = w;
    if (this.#canvas.height !== h) this.#canvas.height = h;
  }

  /** Replaces the canvas with a new one, which can have any context. */
  replaceCanvas(): void {
    const replacement = this.#canvas.cloneNode(false) as HTMLCanvasElement;
    this.#observer.unobserve(this.#canvas);
    this.#canvas.replaceWith(replacement);
    this.#canvas = replacement;
    this.#observer.observe(replacement);
  }

  destroy(): void {
    this.#observer.disconnect();
    containers.delete(this.container);
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
  /** Undoes the wrapping for the current canvas. */
  unwrap: (canvas: HTMLCanvasElement) => void;
}

/**
 * Replaces a canvas with a container around it. A side that the page sets in per cent, or not at all, becomes the
 * container's; a side that it sets as a length (px, vh, …) stays the canvas's own, and the container follows.
 */
function wrapCanvas(canvas: HTMLCanvasElement): WrappedCanvas {
  const container = element("div", "map3d");
  const before = canvas.style.cssText;
  canvas.style.display = "none"; // so that computed sizes come from the style sheet, not from the layout
  const style = getComputedStyle(canvas);
  const isOutOfFlow = style.position === "absolute" || style.position === "fixed";
  container.style.position = isOutOfFlow ? style.position : "relative";
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

/** Makes an element that is not a canvas the container itself. */
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

import type { ImageLayer, Map3D, View } from "./map3d.module.js";
import { clearBox, computeHaze } from "./hazeMask";

/** Pixels of the mask along each side; it covers the square of a view. */
const SIDE_PX = 128;

type ColorBytes = readonly number[];
type Draw = (context: CanvasRenderingContext2D) => void;

/** Lets the content fade into the background towards its edge, over both drawers, and colours the background by the light of the sky. */
export class Haze {
  readonly #view: Map3D;
  readonly #layer: ImageLayer;
  readonly #canvas = document.createElement("canvas");
  readonly #masks = new Map<string, Promise<Uint8ClampedArray | null>>();
  #mask: Uint8ClampedArray | null = null;
  #rgb: ColorBytes = [];
  #direction = "";

  /** @param layer one whose manifest has loaded */
  constructor(view: Map3D, layer: ImageLayer) {
    [this.#view, this.#layer] = [view, layer];
    [this.#canvas.width, this.#canvas.height, this.#canvas.className] = [SIDE_PX, SIDE_PX, "haze"];
    view.canvas.after(this.#canvas);
    view.frameEvents.on("move", () => this.#place());
    view.on("idle", () => {
      void this.#update();
    });
    view.on("lightchange", () => this.#color());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#color());
    this.#color();
  }

  /** Follows the map; hides while the view turns. */
  #place(): void {
    const square = this.#findSquare();
    if (!square) return;
    if (this.#view.direction !== this.#direction) this.#canvas.classList.remove("shown");
    const [x, y, size] = square;
    this.#canvas.style.transform = `translate(${x.toFixed(2)}px, ${y.toFixed(2)}px) scale(${(size / SIDE_PX).toFixed(5)})`;
  }

  /** Returns left, top and side of the view's square, CSS pixels of the map. */
  #findSquare(): readonly [x: number, y: number, size: number] | null {
    const camera = this.#view.getViewState()?.camera;
    if (!camera) return null;
    const { u0, v0, size } = camera.frame;
    const px_m = this.#view.metresPerPixel;
    return [(u0 - camera.u) / px_m + camera.width / 2, (camera.v - v0) / px_m + camera.height / 2, size / px_m];
  }

  /** Returns a function that draws the present haze over a picture of the map; undefined without haze. @param paper the picture's background, if it is not that of the map */
  capture(paper?: ColorBytes): Draw | undefined {
    const [square, mask] = [this.#findSquare(), this.#mask];
    if (!square || !mask || this.#canvas.hidden || !this.#canvas.classList.contains("shown")) return undefined;
    const [x, y, size] = square;
    const canvas = this.#canvas.cloneNode() as HTMLCanvasElement;
    fill(canvas, mask, paper ?? this.#rgb);
    return (context) => context.drawImage(canvas, x, y, size, size);
  }

  /** Shows the haze of the current view once its mask is known. Without one, as offline, there is no haze. */
  async #update(): Promise<void> {
    const { direction } = this.#view;
    if (direction === this.#direction && this.#canvas.classList.contains("shown")) return;
    const view = this.#layer.rendering?.views.get(direction);
    if (!view) return;
    const made = this.#masks.get(direction) ?? this.#makeMask(view);
    this.#masks.set(direction, made);
    const mask = await made.catch(() => null);
    if (direction !== this.#view.direction) return;
    [this.#mask, this.#direction] = [mask, direction];
    this.#color();
    this.#place();
    this.#canvas.classList.toggle("shown", mask !== null);
  }

  /** Reads where the content ends from the tile of the whole view. */
  async #makeMask(view: View): Promise<Uint8ClampedArray | null> {
    const color = this.#layer.rendering?.layers.get("color");
    if (!color || color.format === "jpeg") return null;
    const data = await this.#layer.source.tile(view, color, { z: 0, x: 0, y: 0 });
    if (data === null) return null;
    const bitmap =
      data instanceof ArrayBuffer
        ? await createImageBitmap(new Blob([data], { type: color.media_type }))
        : "bitmap" in data
          ? data.bitmap
          : null;
    const context = Object.assign(document.createElement("canvas"), { width: SIDE_PX, height: SIDE_PX }).getContext("2d", {
      willReadFrequently: true,
    });
    if (!bitmap || !context) return null;
    context.drawImage(bitmap, 0, 0, SIDE_PX, SIDE_PX);
    bitmap.close();
    const { data: pixels } = context.getImageData(0, 0, SIDE_PX, SIDE_PX);
    const haze = computeHaze(
      Uint8Array.from({ length: SIDE_PX * SIDE_PX }, (_, k) => ((pixels[4 * k + 3] ?? 0) > 127 ? 1 : 0)),
      SIDE_PX,
    );
    const box = this.#layer.rendering?.json.objects?.box;
    if (haze && box) clearBox(haze, SIDE_PX, view.frame, box);
    return haze;
  }

  /** Colours background and haze: the page's paper in the light of the sky. High contrast keeps its own colours. */
  #color(): void {
    const plain = matchMedia("(prefers-contrast: more), (forced-colors: active)").matches;
    const paper = (
      getComputedStyle(document.documentElement)
        .getPropertyValue("--paper")
        .trim()
        .match(/[0-9a-f]{2}/gi) ?? []
    ).map((part) => parseInt(part, 16));
    this.#rgb = paper.map((part, k) => Math.round(part * Math.min(this.#view.light.sky_rgb[k as 0], 1) ** 2));
    this.#canvas.hidden = plain || paper.length < 3;
    if (this.#canvas.hidden) return;
    this.#view.setBackground(`rgb(${this.#rgb.join(" ")})`);
    if (this.#mask) fill(this.#canvas, this.#mask, this.#rgb);
  }
}

/** Fills a canvas with a colour of the opacity of a mask. */
function fill(canvas: HTMLCanvasElement, mask: Uint8ClampedArray, rgb: ColorBytes): void {
  const image = new ImageData(SIDE_PX, SIDE_PX);
  mask.forEach((alpha, k) => image.data.set([...rgb, alpha], 4 * k));
  canvas.getContext("2d")?.putImageData(image, 0, 0);
}

import { element } from "../core/dom";
import type { Vec3 } from "../core/vec";
import type { Camera } from "../geo/camera";
import { DecodeError, DrawError, FetchError, Map3D, UsageError, type Addable, type ImageLayer } from "../map3d";

/** Size and scale of the picture. */
export interface PictureExtent {
  /** Picture pixels. */
  readonly width: number;
  readonly height: number;
  /** Picture pixels per CSS pixel of the map. */
  readonly scale: number;
}

export interface PieceOptions {
  /** Aborts the rendering. Default: none. */
  readonly signal?: AbortSignal | undefined;
  /** Called after each piece. Default: none. */
  readonly progress?: ((done: number, total: number) => void) | undefined;
}

interface Fraction {
  readonly x: number;
  readonly y: number;
}

/** Largest size of a piece, pixels, small enough for any browser. */
const PIECE_PX = 1024;

/** Draws the view of a map piece by piece, with a second map off the screen. @throws the error of a tile, or the signal's reason */
export async function drawPieces(
  shown: Map3D,
  { width, height, scale }: PictureExtent,
  into: CanvasRenderingContext2D,
  { signal, progress }: PieceOptions,
): Promise<void> {
  const state = shown.getViewState();
  if (!state || shown.drawer === null) throw new UsageError('the map is not ready; wait for its event "ready"');
  const { camera, origin } = state;
  const side = { width: Math.min(PIECE_PX, width), height: Math.min(PIECE_PX, height) };
  const px_m = shown.metresPerPixel / scale;
  const box = createBox(Math.ceil(side.width / scale) + 1, Math.ceil(side.height / scale) + 1);
  const [across, down] = [Math.ceil(width / side.width), Math.ceil(height / side.height)];
  const offscreen = new OffscreenMap(shown, box, scale);
  try {
    await offscreen.ready(signal);
    await offscreen.estimateLight({ ...camera, width: Math.round(width / scale), height: Math.round(height / scale) }, origin, signal);
    for (let k = 0; k < across * down; k++) {
      const [x, y] = [(k % across) * side.width, Math.floor(k / across) * side.height];
      const middle = { x: x + (box.clientWidth * scale) / 2, y: y + (box.clientHeight * scale) / 2 };
      const corner = { x: (x - width / 2) / scale / camera.width + 0.5, y: (y - height / 2) / scale / camera.height + 0.5 };
      offscreen.clip(corner, { x: box.clientWidth / camera.width, y: box.clientHeight / camera.height });
      offscreen.map.syncCamera(
        { ...camera, u: camera.u + (middle.x - width / 2) * px_m, v: camera.v - (middle.y - height / 2) * px_m },
        origin,
      );
      await offscreen.complete(signal);
      into.drawImage(offscreen.map.canvas, 0, 0, side.width, side.height, x, y, side.width, side.height);
      progress?.(k + 1, across * down);
    }
  } finally {
    offscreen.remove();
  }
}

/** Creates an invisible, inert element of a size. */
function createBox(width: number, height: number): HTMLElement {
  const box = element("div", "", { "aria-hidden": "true", inert: "" });
  Object.assign(box.style, {
    position: "fixed",
    left: "0",
    top: "0",
    width: `${String(width)}px`,
    height: `${String(height)}px`,
    visibility: "hidden",
    contain: "strict",
    zIndex: "-1",
  });
  document.body.append(box);
  return box;
}

/** A map off the screen with copies of another map's layers. */
class OffscreenMap {
  readonly map: Map3D;
  readonly #box: HTMLElement;
  readonly #layers: readonly ImageLayer[];
  readonly #shown: readonly ImageLayer[];
  readonly #failed: Promise<never>;
  /** Estimates light as on the map; undefined: nothing does. */
  readonly #shade: Addable<never> | undefined;

  constructor(shown: Map3D, box: HTMLElement, scale: number) {
    this.#box = box;
    const { light, drawer, options } = shown;
    this.map = new Map3D(box, {
      light,
      ...(drawer && { drawer }),
      direction: shown.direction,
      concurrency: options.concurrency,
      ...(options.cacheBytes !== undefined && { cacheBytes: options.cacheBytes }),
      workers: options.workers,
      dataSaver: false,
      pixelRatio: scale,
      maxTileRatio: Infinity,
      finer: scale >= 1.5 ? 0.5 : 0,
      controls: false,
      attribution: false,
      preserveDrawingBuffer: true,
    });
    this.#failed = new Promise((_, reject) => {
      this.map.on("error", ({ error }) => {
        if ([FetchError, DecodeError, DrawError].some((kind) => error instanceof kind)) reject(error);
      });
      this.map.on("contextlost", () =>
        reject(new DrawError("the graphics context was lost during the export; try again or choose a smaller size")),
      );
    });
    this.#failed.catch(() => undefined);
    this.#shown = shown.layers.filter(({ rendering }) => rendering);
    this.#layers = this.#shown.map((layer) => layer.copy());
    this.#shade = shown.lightEstimator?.copy?.();
    if (this.#shade) this.map.add(this.#shade);
  }

  /** Adds the layers and waits for their manifests. */
  async ready(signal: AbortSignal | undefined): Promise<void> {
    const ready = this.#layers.map((layer) => new Promise((done) => layer.once("ready", done)));
    for (const layer of this.#layers) layer.addTo(this.map);
    await this.#orFail(Promise.all(ready), signal);
  }

  /** Estimates the light of the whole picture at the resolution of CSS pixels, as on the screen, and keeps it for the pieces. */
  async estimateLight(camera: Camera, origin: Vec3, signal: AbortSignal | undefined): Promise<void> {
    const {
      map: { lightEstimator, options },
    } = this;
    const { pixelRatio } = options;
    if (!lightEstimator || !this.#shade?.needs?.length || !pixelRatio) return;
    const { clientWidth, clientHeight } = this.#box;
    options.pixelRatio = 1;
    await this.#resize(camera.width, camera.height);
    this.map.syncCamera(camera, origin);
    await this.complete(signal);
    lightEstimator.held = true;
    options.pixelRatio = pixelRatio;
    await this.#resize(clientWidth, clientHeight);
  }

  /** Resizes the map, which learns of it before a later observer does. */
  async #resize(width: number, height: number): Promise<void> {
    Object.assign(this.#box.style, { width: `${String(width)}px`, height: `${String(height)}px` });
    await new Promise((done) => {
      new ResizeObserver(done).observe(this.map.canvas);
    });
  }

  /** Clips the layers like those of the map. @param corner, size the piece, as fractions of the map */
  clip(corner: Fraction, size: Fraction): void {
    this.#layers.forEach((layer, k) => {
      const clip = this.#shown[k]?.clip;
      const [across, down] = [(at: number): number => (at - corner.x) / size.x, (at: number): number => (at - corner.y) / size.y];
      layer.setClip(
        clip
          ? [
              clip[0] === 0 ? -1e6 : across(clip[0]),
              clip[1] === 0 ? -1e6 : down(clip[1]),
              clip[2] === 1 ? 1e6 : across(clip[2]),
              clip[3] === 1 ? 1e6 : down(clip[3]),
            ]
          : null,
      );
    });
  }

  /** Waits until the view is complete. */
  async complete(signal: AbortSignal | undefined): Promise<void> {
    await this.#orFail(new Promise((done) => this.map.once("idle", done)), signal);
  }

  remove(): void {
    this.map.remove();
    this.#box.remove();
  }

  async #orFail(done: Promise<unknown>, signal: AbortSignal | undefined): Promise<void> {
    signal?.throwIfAborted();
    const ending = new AbortController();
    const aborted = new Promise<never>((_, reject) => {
      signal?.addEventListener("abort", () => reject(signal.reason as Error), { signal: ending.signal });
    });
    await Promise.race([done, this.#failed, aborted]).finally(() => ending.abort());
  }
}

import { element } from "../core/dom";
import { DecodeError, DrawError, FetchError, map, UsageError, type imageLayer } from "../map3d";

/** The picture's place over the map's view. */
export interface Extent {
  /** Picture pixels. */
  readonly width: number;
  readonly height: number;
  /** Picture pixels a CSS pixel of the map. */
  readonly scale: number;
}

export interface Watch {
  readonly signal?: AbortSignal | undefined;
  /** After each piece. */
  readonly progress?: ((done: number, total: number) => void) | undefined;
}

interface Share {
  readonly x: number;
  readonly y: number;
}

/** Drawn at once, picture pixels: any browser has room for so many. */
const PIECE_PX = 1024;

/** Paints what a map shows, in all its looks, piece by piece by a map of its own off the screen. @throws what a tile's fetch threw, or the signal's reason */
export async function paintPieces(shown: map, { width, height, scale }: Extent, into: CanvasRenderingContext2D, { signal, progress }: Watch): Promise<void> {
  const sight = shown.getViewState();
  if (!sight || shown.drawer === null) throw new UsageError("the map shows nothing yet; wait for its event \"ready\"");
  const { camera, origin } = sight;
  const side = { width: Math.min(PIECE_PX, width), height: Math.min(PIECE_PX, height) };
  const px_m = shown.metresPerPixel / scale;
  const box = boxOf(Math.ceil(side.width / scale) + 1, Math.ceil(side.height / scale) + 1);
  const [across, down] = [Math.ceil(width / side.width), Math.ceil(height / side.height)];
  const hidden = new Hidden(shown, box, scale);
  try {
    await hidden.ready(signal);
    for (let k = 0; k < across * down; k++) {
      const [x, y] = [(k % across) * side.width, Math.floor(k / across) * side.height];
      const middle = { x: x + (box.clientWidth * scale) / 2, y: y + (box.clientHeight * scale) / 2 };
      const corner = { x: (x - width / 2) / scale / camera.width + 0.5, y: (y - height / 2) / scale / camera.height + 0.5 };
      hidden.clip(corner, { x: box.clientWidth / camera.width, y: box.clientHeight / camera.height });
      hidden.map.syncCamera({ ...camera, u: camera.u + (middle.x - width / 2) * px_m, v: camera.v - (middle.y - height / 2) * px_m }, origin);
      await hidden.rest(signal);
      into.drawImage(hidden.map.canvas, 0, 0, side.width, side.height, x, y, side.width, side.height);
      progress?.(k + 1, across * down);
    }
  } finally {
    hidden.remove();
  }
}

/** A box that has a size, but is neither seen nor met by keys. */
function boxOf(width: number, height: number): HTMLElement {
  const box = element("div", "", { "aria-hidden": "true", inert: "" });
  Object.assign(box.style, { position: "fixed", left: "0", top: "0", width: `${String(width)}px`, height: `${String(height)}px`, visibility: "hidden", contain: "strict", zIndex: "-1" });
  document.body.append(box);
  return box;
}

/** A map with copies of another one's layers. */
class Hidden {
  readonly map: map;
  readonly #box: HTMLElement;
  readonly #layers: readonly imageLayer[];
  readonly #shown: readonly imageLayer[];
  readonly #failed: Promise<never>;

  constructor(shown: map, box: HTMLElement, scale: number) {
    this.#box = box;
    const { light, drawer, options } = shown;
    this.map = new map(box, {
      light, ...(drawer && { drawer }), direction: shown.direction, concurrency: options.concurrency, ...(options.cacheBytes !== undefined && { cacheBytes: options.cacheBytes }), workers: options.workers,
      dataSaver: false, pixelRatio: scale, finer: scale >= 1.5 ? 0.5 : 0, controls: false, attribution: false, preserveDrawingBuffer: true,
    });
    this.#failed = new Promise((_, reject) => {
      this.map.on("error", ({ error }) => {
        if ([FetchError, DecodeError, DrawError].some((kind) => error instanceof kind)) reject(error);
      });
      this.map.on("contextlost", () => { reject(new DrawError("the graphics context was lost while the picture was made; try again, or a smaller one")); });
    });
    this.#failed.catch(() => undefined);
    this.#shown = shown.layers.filter(({ rendering }) => rendering);
    this.#layers = this.#shown.map((layer) => layer.copy());
  }

  /** All layers' manifests are here, which the map has not drawn yet. */
  async ready(signal: AbortSignal | undefined): Promise<void> {
    const ready = this.#layers.map((layer) => new Promise((done) => layer.once("ready", done)));
    for (const layer of this.#layers) layer.addTo(this.map);
    await this.#unless(Promise.all(ready), signal);
  }

  /** Layers are seen where those of the map are: here is a part of it, from a corner on and of a size (shares of the map's). */
  clip(corner: Share, size: Share): void {
    this.#layers.forEach((layer, k) => {
      const clip = this.#shown[k]?.clip;
      const [across, down] = [(at: number): number => (at - corner.x) / size.x, (at: number): number => (at - corner.y) / size.y];
      layer.setClip(clip ? [clip[0] === 0 ? -1e6 : across(clip[0]), clip[1] === 0 ? -1e6 : down(clip[1]), clip[2] === 1 ? 1e6 : across(clip[2]), clip[3] === 1 ? 1e6 : down(clip[3])] : null);
    });
  }

  /** All of the view is drawn. */
  async rest(signal: AbortSignal | undefined): Promise<void> {
    await this.#unless(new Promise((done) => this.map.once("idle", done)), signal);
  }

  remove(): void {
    this.map.remove();
    this.#box.remove();
  }

  async #unless(done: Promise<unknown>, signal: AbortSignal | undefined): Promise<void> {
    signal?.throwIfAborted();
    const ending = new AbortController();
    const aborted = new Promise<never>((_, reject) => {
      signal?.addEventListener("abort", () => { reject(signal.reason as Error); }, { signal: ending.signal });
    });
    await Promise.race([done, this.#failed, aborted]).finally(() => { ending.abort(); });
  }
}

import { CanvasDrawer } from "../draw/canvas/canvasDrawer";
import type { Drawer, DrawerEvents, FrameContent, CustomLayer } from "../draw/drawer";
import type { LightEstimator } from "../draw/lightEstimator";
import { WebGLDrawer } from "../draw/webgl/webglDrawer";
import type { Light } from "../geo/light";
import type { LayerKind } from "../geo/manifest";
import { Cache } from "../tiles/cache";
import { DENSE_DPR } from "../tiles/cover";
import { Decoder } from "../tiles/decoder";
import { RequestQueue } from "../tiles/queue";
import type { TileResources, CachedTile } from "../tiles/layerTiles";
import { findCombinedLayers } from "./depthGroups";
import type { imageLayer } from "./imageLayer";
import { computeSceneDepthRange, type LayerPlan } from "./layerPlan";
import type { FilledOptions } from "./options";
import type { ViewState } from "./layerContext";
import type { TransitionFrame } from "./viewTransition";
import type { Viewport } from "./viewport";

export interface FrameRendererEvents {
  lost(): void;
  restored(): void;
  /** Another canvas has taken the place of the map's; the picture comes back. */
  replaced(): void;
  changed(): void;
  failed(error: Error): void;
}

export type TransitionScene = Omit<TransitionFrame, "camera" | "tilesChanged">;

/** A context that has not come back after this time is lost for good. */
const RESTORE_MS = 5000;
/** Of tiles that are kept, for each device pixel, and at least. On dense screens tile pixels are fewer, see `levelFor`. */
const [KEPT_BYTES, KEPT_DENSE_BYTES, LEAST_BYTES] = [60, 20, 24e6];

export interface FrameResult {
  readonly plans: readonly LayerPlan[];
  /** Nothing is missing in view. */
  readonly complete: boolean;
}

/** What a frame shows. */
export interface FrameInput {
  readonly layers: readonly imageLayer[];
  readonly light: Readonly<Light>;
  /** Layers that are read, besides those that are shown. */
  readonly requiredKinds: readonly LayerKind[];
  /** Finds light that was not rendered. */
  readonly lightEstimator: LightEstimator | null;
  /** The picture is under way: what is costly may be rough. */
  readonly moving: boolean;
}

/** Makes a frame: asks the layers what they want, fetches it, has it drawn. Owns tiles and drawer. */
export class FrameRenderer {
  readonly tileResources: TileResources;
  /** What is seen among the layers. */
  readonly customLayers = new Set<CustomLayer>();
  readonly #viewport: Viewport;
  readonly #cache: Cache<CachedTile>;
  readonly #queue: RequestQueue;
  readonly #decoder: Decoder;
  readonly #options: FilledOptions;
  readonly #events: FrameRendererEvents;
  #drawer: Drawer;
  /** Guests are shown: from when the depth of all that was in view was here, so that no tile had to wait for its own. */
  #showsCustomLayers = false;
  #restoreTimer: ReturnType<typeof setTimeout> | undefined;

  /** @throws DrawError when the browser cannot draw */
  constructor(viewport: Viewport, options: FilledOptions, events: FrameRendererEvents) {
    this.#viewport = viewport;
    this.#options = options;
    this.#events = events;
    this.#drawer = this.#createDrawer(options.drawer);
    this.#cache = new Cache<CachedTile>(options.cacheBytes ?? LEAST_BYTES, (key, { data }) => {
      if (data && "bitmap" in data) data.bitmap.close();
      this.#drawer.release(key);
    });
    this.#queue = new RequestQueue(options.concurrency);
    this.#decoder = new Decoder(options.workers);
    this.tileResources = { cache: this.#cache, queue: this.#queue, decoder: this.#decoder };
  }

  get busy(): boolean {
    return this.#queue.busy || this.#drawer.busy;
  }

  get drawer(): Pick<Drawer, "name" | "note" | "element"> {
    return this.#drawer;
  }

  get cacheBytes(): number {
    return this.#cache.bytes;
  }

  /** @param turn paints a movement, where that can be done, in place of the frame */
  render(viewState: ViewState, input: FrameInput, turn: ((scene: TransitionScene) => void) | null): FrameResult {
    const { layers, light, requiredKinds, lightEstimator, moving } = input;
    this.#viewport.fitCanvas(viewState.dpr);
    const { width, height } = this.#viewport.canvas;
    this.#cache.setLimit(this.#options.cacheBytes ?? Math.max(LEAST_BYTES, (viewState.dpr >= DENSE_DPR ? KEPT_DENSE_BYTES : KEPT_BYTES) * width * height));
    this.#cache.startTick();
    const { gl } = this.#drawer;
    this.#showsCustomLayers &&= this.customLayers.size > 0 && gl !== null;
    const customLayers = this.#showsCustomLayers ? [...this.customLayers] : [];
    const combined = findCombinedLayers(layers, this.#showsCustomLayers);
    const planned = layers.flatMap((layer) => {
      const plan = layer.plan(viewState, light, requiredKinds, combined.includes(layer));
      return plan ? [{ layer, plan }] : [];
    });
    const before = (layer: imageLayer): number | null => (combined.includes(layer) ? combined.indexOf(layer) : null);
    this.#queue.setRequests(planned.flatMap(({ plan }) => plan.requests));
    const complete = !layers.some((layer) => layer.isLoading) && planned.every(({ plan }) => plan.complete);
    if (turn && gl) turn({ gl, width, height, complete, getDepthRange: (frame) => computeSceneDepthRange(viewState, frame, layers, customLayers), drawView: (camera, range, framebuffer) => { this.#drawView({ ...viewState, camera, dpr: 1 }, input, customLayers, { range, framebuffer }); } });
    else this.#drawer.draw({ camera: viewState.camera, width, height, dpr: viewState.dpr, light, customLayers, lighting: lightEstimator && { by: lightEstimator, moving }, passes: planned.map(({ layer, plan }) => layer.makePass(plan, viewState, before(layer))) });
    if (complete && gl && this.customLayers.size > 0 && !this.#showsCustomLayers) {
      this.#showsCustomLayers = true;
      this.#events.changed();
    }
    return { plans: planned.map(({ plan }) => plan), complete: complete && !this.#drawer.busy };
  }

  /** What is in memory, with the depth of all layers that have any. */
  #drawView(viewState: ViewState, { layers, light, lightEstimator }: FrameInput, customLayers: readonly CustomLayer[], target: NonNullable<FrameContent["target"]>): void {
    const { camera } = viewState;
    const { width, height } = camera;
    const passes = layers.filter((layer) => layer.isCombinable).flatMap((layer, k) => {
      const plan = layer.plan(viewState, light, [], true);
      return plan ? [layer.makePass(plan, viewState, k)] : [];
    });
    this.#drawer.draw({ camera, width, height, dpr: 1, light, customLayers, lighting: lightEstimator && { by: lightEstimator, moving: false }, passes, target });
  }

  /** Forgets the tiles of a layer that has left. */
  dropTiles(prefix: string): void {
    this.#cache.prune((key) => key.startsWith(prefix));
  }

  destroy(): void {
    clearTimeout(this.#restoreTimer);
    this.#queue.setRequests([]);
    this.#cache.prune(() => true);
    this.#decoder.stop();
    this.#drawer.destroy();
  }

  /** @throws DrawError */
  #createDrawer(kind: FilledOptions["drawer"]): Drawer {
    const { canvas } = this.#viewport;
    const events: DrawerEvents = {
      lost: () => { this.#onContextLost(); },
      restored: () => { this.#onContextRestored(); },
      changed: () => { this.#events.changed(); },
      failed: (error) => { this.#events.failed(error); },
    };
    const preserve = this.#options.preserveDrawingBuffer;
    if (kind === "canvas") return new CanvasDrawer(canvas, preserve, events);
    try {
      return new WebGLDrawer(canvas, { preserve, requireGpu: kind === "auto" }, events);
    } catch (reason) {
      if (kind === "webgl") throw reason;
      // A canvas that has tried WebGL gives nothing else.
      if (canvas.getContext("2d") === null) this.#viewport.replaceCanvas();
      return new CanvasDrawer(this.#viewport.canvas, preserve, events);
    }
  }

  #onContextLost(): void {
    if (this.#options.drawer === "auto") this.#restoreTimer ??= setTimeout(() => { this.#switchToCanvas(); }, RESTORE_MS);
    this.#events.lost();
  }

  #onContextRestored(): void {
    clearTimeout(this.#restoreTimer);
    this.#restoreTimer = undefined;
    this.#dropUploadedTiles();
    this.#events.restored();
  }

  /** A canvas that had WebGL gives no 2D context: a fresh one takes its place. */
  #switchToCanvas(): void {
    this.#drawer.destroy();
    this.#viewport.replaceCanvas();
    this.#drawer = this.#createDrawer("canvas");
    this.#dropUploadedTiles();
    this.#events.replaced();
  }

  /** Forgets the tiles that only the drawer had. */
  #dropUploadedTiles(): void {
    this.#cache.prune((_, { data, empty }) => data === null && !empty);
  }
}

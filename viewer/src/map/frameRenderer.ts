import { CanvasDrawer } from "../draw/canvas/canvasDrawer";
import type { Drawer, DrawerEvents, FrameContent, CustomLayer } from "../draw/drawer";
import type { LightEstimator } from "../draw/lightEstimator";
import { WebGLDrawer } from "../draw/webgl/webglDrawer";
import type { Light } from "../geo/light";
import type { LayerKind } from "../tiles/tileData";
import { Cache, computeCacheBytes, MIN_CACHE_BYTES } from "../tiles/cache";
import { Decoder } from "../tiles/decoder";
import { RequestQueue, type TileRequest } from "../tiles/queue";
import type { TileResources, CachedTile } from "../tiles/layerTiles";
import { findCombinedLayers } from "./depthGroups";
import type { ImageLayer } from "./imageLayer";
import { computeSceneDepthRange, type LayerPlan } from "./layerPlan";
import type { FilledOptions } from "./options";
import type { ViewState } from "./layerContext";
import type { TransitionFrame } from "./viewTransition";
import type { Viewport } from "./viewport";

export interface FrameRendererEvents {
  lost(): void;
  restored(): void;
  /** Another canvas has replaced the map's; drawing continues there. */
  replaced(): void;
  changed(): void;
  failed(error: Error): void;
}

export type TransitionScene = Omit<TransitionFrame, "camera" | "tilesChanged">;

/** A context that is not restored by then is lost for good. */
const RESTORE_MS = 5000;

/** The result of a frame. */
export interface FrameResult {
  readonly plans: readonly LayerPlan[];
  /** Whether nothing is missing in view. */
  readonly complete: boolean;
  /** The plans of the view that waits for its tiles; null: none waits. */
  readonly next: readonly LayerPlan[] | null;
}

/** What is shown, wherever the camera is. */
export interface PlanInput {
  readonly layers: readonly ImageLayer[];
  readonly light: Readonly<Light>;
  /** Kinds of tiles to fetch in addition to those shown. */
  readonly requiredKinds: readonly LayerKind[];
}

/** The input of a frame. */
export interface FrameInput extends PlanInput {
  /** Estimates light that was not rendered. */
  readonly lightEstimator: LightEstimator | null;
  /** Whether the view is moving, so that costly parts may be approximate. */
  readonly moving: boolean;
  /** A view whose tiles are fetched before all others. */
  readonly next: ViewState | null;
  /** Views whose tiles are fetched after all others. */
  readonly ahead: readonly ViewState[];
}

const listRequests = (plans: readonly LayerPlan[]): TileRequest[] => plans.flatMap(({ requests }) => requests);

/** Renders frames: plans each layer, requests its tiles, and lets the drawer draw. Owns tiles and drawer. */
export class FrameRenderer {
  readonly tileResources: TileResources;
  /** Layers that are not made of tiles. */
  readonly customLayers = new Set<CustomLayer>();
  readonly #viewport: Viewport;
  readonly #cache: Cache<CachedTile>;
  readonly #queue: RequestQueue;
  readonly #decoder: Decoder;
  readonly #options: FilledOptions;
  readonly #events: FrameRendererEvents;
  #drawer: Drawer;
  /** Custom layers are shown once all depths in view have loaded, so that no tile has to wait for its own. */
  #showsCustomLayers = false;
  #restoreTimer: ReturnType<typeof setTimeout> | undefined;

  /** @throws DrawError when the browser cannot draw */
  constructor(viewport: Viewport, options: FilledOptions, events: FrameRendererEvents) {
    this.#viewport = viewport;
    this.#options = options;
    this.#events = events;
    this.#drawer = this.#createDrawer(options.drawer);
    this.#cache = new Cache<CachedTile>(options.cacheBytes ?? MIN_CACHE_BYTES, (key, { data }) => {
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

  get drawer(): Pick<Drawer, "name" | "element" | "showsPreviousView"> {
    return this.#drawer;
  }

  get cacheBytes(): number {
    return this.#cache.bytes;
  }

  /** Renders a frame. @param transition draws a view transition instead, where WebGL is available */
  render(viewState: ViewState, input: FrameInput, transition: ((scene: TransitionScene) => void) | null): FrameResult {
    const { layers, light, lightEstimator, moving } = input;
    this.#viewport.fitCanvas(viewState.dpr);
    const { width, height } = this.#viewport.canvas;
    this.#cache.setLimit(this.#options.cacheBytes ?? computeCacheBytes(viewState, width * height));
    this.#cache.startTick();
    const { gl } = this.#drawer;
    this.#showsCustomLayers &&= this.customLayers.size > 0 && gl !== null;
    const customLayers = this.#showsCustomLayers ? [...this.customLayers] : [];
    const combined = findCombinedLayers(layers, this.#showsCustomLayers);
    const planned = this.#plan(viewState, input);
    const next = input.next && this.plan(input.next, input);
    const before = (layer: ImageLayer): number | null => (combined.includes(layer) ? combined.indexOf(layer) : null);
    const plans = planned.map(({ plan }) => plan);
    this.#queue.setRequests(listRequests([...(next ?? []), ...plans]), listRequests(input.ahead.flatMap((each) => this.plan(each, input))));
    const complete = !layers.some((layer) => layer.isLoading) && planned.every(({ plan }) => plan.complete);
    if (transition && gl)
      transition({
        gl,
        width,
        height,
        complete,
        getDepthRange: (frame) => computeSceneDepthRange(viewState, frame, layers, customLayers),
        drawView: (camera, range, framebuffer) => {
          this.#drawView({ ...viewState, camera, dpr: 1 }, input, customLayers, { range, framebuffer });
        },
      });
    else
      this.#drawer.draw({
        camera: viewState.camera,
        width,
        height,
        dpr: viewState.dpr,
        light,
        customLayers,
        lighting: lightEstimator && { estimator: lightEstimator, moving },
        passes: planned.map(({ layer, plan }) => layer.makePass(plan, viewState, before(layer))),
      });
    if (complete && gl && this.customLayers.size > 0 && !this.#showsCustomLayers) {
      this.#showsCustomLayers = true;
      this.#events.changed();
    }
    return { plans, complete: complete && !next && !this.#drawer.busy, next };
  }

  /** Plans what the layers show in a view. */
  plan(viewState: ViewState, input: PlanInput): LayerPlan[] {
    return this.#plan(viewState, input).map(({ plan }) => plan);
  }

  #plan(viewState: ViewState, { layers, light, requiredKinds }: PlanInput): { layer: ImageLayer; plan: LayerPlan }[] {
    const combined = findCombinedLayers(layers, this.#showsCustomLayers);
    return layers.flatMap((layer) => {
      const plan = layer.plan(viewState, light, requiredKinds, combined.includes(layer));
      return plan ? [{ layer, plan }] : [];
    });
  }

  /** Draws a view from the tiles in memory, with the depth of all layers that have any. */
  #drawView(
    viewState: ViewState,
    { layers, light, lightEstimator }: FrameInput,
    customLayers: readonly CustomLayer[],
    target: NonNullable<FrameContent["target"]>,
  ): void {
    const { camera } = viewState;
    const { width, height } = camera;
    const passes = layers
      .filter((layer) => layer.isCombinable)
      .flatMap((layer, k) => {
        const plan = layer.plan(viewState, light, [], true);
        return plan ? [layer.makePass(plan, viewState, k)] : [];
      });
    this.#drawer.draw({
      camera,
      width,
      height,
      dpr: 1,
      light,
      customLayers,
      lighting: lightEstimator && { estimator: lightEstimator, moving: false },
      passes,
      target,
    });
  }

  /** Drops the tiles of a removed layer. */
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
      lost: () => this.#onContextLost(),
      restored: () => this.#onContextRestored(),
      changed: () => this.#events.changed(),
      failed: (error) => this.#events.failed(error),
    };
    const preserve = this.#options.preserveDrawingBuffer;
    if (kind === "canvas") return new CanvasDrawer(canvas, preserve, events);
    try {
      return new WebGLDrawer(canvas, { preserve, requireGpu: kind === "auto" }, events);
    } catch (reason) {
      if (kind === "webgl") throw reason;
      // A canvas that has tried WebGL may refuse another context.
      if (canvas.getContext("2d") === null) this.#viewport.replaceCanvas();
      return new CanvasDrawer(this.#viewport.canvas, preserve, events);
    }
  }

  #onContextLost(): void {
    if (this.#options.drawer === "auto") this.#restoreTimer ??= setTimeout(() => this.#switchToCanvas(), RESTORE_MS);
    this.#events.lost();
  }

  #onContextRestored(): void {
    clearTimeout(this.#restoreTimer);
    this.#restoreTimer = undefined;
    this.#dropUploadedTiles();
    this.#events.restored();
  }

  /** Continues on a new canvas, since one that had WebGL refuses a 2D context. */
  #switchToCanvas(): void {
    this.#drawer.destroy();
    this.#viewport.replaceCanvas();
    this.#drawer = this.#createDrawer("canvas");
    this.#dropUploadedTiles();
    this.#events.replaced();
  }

  /** Drops tiles that only the drawer had. */
  #dropUploadedTiles(): void {
    this.#cache.prune((_, { data, empty }) => data === null && !empty);
  }
}

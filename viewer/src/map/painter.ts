import { CanvasDrawer } from "../draw/canvas/canvasDrawer";
import type { Drawer, DrawerEvents, FrameSpec, CustomLayer } from "../draw/drawer";
import type { LightEstimator } from "../draw/lightEstimator";
import { WebGLDrawer } from "../draw/webgl/webglDrawer";
import type { Light } from "../geo/light";
import type { LayerKind } from "../geo/manifest";
import { Cache } from "../tiles/cache";
import { DENSE } from "../tiles/cover";
import { Decoder } from "../tiles/decoder";
import { Queue } from "../tiles/queue";
import type { TileResources, CachedTile } from "../tiles/layerTiles";
import { combinedOf } from "./combined";
import type { imageLayer } from "./imageLayer";
import { rangeAlong, type LayerPlan } from "./layerPlan";
import type { FilledOptions } from "./options";
import type { ViewState } from "./layerContext";
import type { TransitionFrame } from "./viewTransition";
import type { Viewport } from "./viewport";

export interface PainterEvents {
  lost(): void;
  restored(): void;
  /** Another canvas has taken the place of the map's; the picture comes back. */
  replaced(): void;
  changed(): void;
  failed(error: Error): void;
}

export type Turning = Omit<TransitionFrame, "camera" | "changed">;

/** A context that has not come back after this time is lost for good. */
const RESTORE_MS = 5000;
/** Of tiles that are kept, for each device pixel, and at least. On dense screens tile pixels are fewer, see `levelFor`. */
const [KEPT_BYTES, KEPT_DENSE_BYTES, LEAST_BYTES] = [60, 20, 24e6];

export interface Painted {
  readonly plans: readonly LayerPlan[];
  /** Nothing is missing in view. */
  readonly complete: boolean;
}

/** What a frame shows. */
export interface Content {
  readonly layers: readonly imageLayer[];
  readonly light: Readonly<Light>;
  /** Layers that are read, besides those that are shown. */
  readonly kinds: readonly LayerKind[];
  /** Finds light that was not rendered. */
  readonly shade: LightEstimator | null;
  /** The picture is under way: what is costly may be rough. */
  readonly moving: boolean;
}

/** Makes a frame: asks the layers what they want, fetches it, has it drawn. Owns tiles and drawer. */
export class Painter {
  readonly shared: TileResources;
  /** What is seen among the layers. */
  readonly customLayers = new Set<CustomLayer>();
  readonly #viewport: Viewport;
  readonly #cache: Cache<CachedTile>;
  readonly #queue: Queue;
  readonly #decoder: Decoder;
  readonly #options: FilledOptions;
  readonly #events: PainterEvents;
  #drawer: Drawer;
  /** Guests are shown: from when the depth of all that was in view was here, so that no tile had to wait for its own. */
  #seated = false;
  #waiting: ReturnType<typeof setTimeout> | undefined;

  /** @throws DrawError when the browser cannot draw */
  constructor(viewport: Viewport, options: FilledOptions, events: PainterEvents) {
    this.#viewport = viewport;
    this.#options = options;
    this.#events = events;
    this.#drawer = this.#open(options.drawer);
    this.#cache = new Cache<CachedTile>(options.cacheBytes ?? LEAST_BYTES, (key, { data }) => {
      if (data && "bitmap" in data) data.bitmap.close();
      this.#drawer.release(key);
    });
    this.#queue = new Queue(options.concurrency);
    this.#decoder = new Decoder(options.workers);
    this.shared = { cache: this.#cache, queue: this.#queue, decoder: this.#decoder };
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
  paint(sight: ViewState, content: Content, turn: ((scene: Turning) => void) | null): Painted {
    const { layers, light, kinds, shade, moving } = content;
    this.#viewport.fitCanvas(sight.dpr);
    const { width, height } = this.#viewport.canvas;
    this.#cache.limit(this.#options.cacheBytes ?? Math.max(LEAST_BYTES, (sight.dpr >= DENSE ? KEPT_DENSE_BYTES : KEPT_BYTES) * width * height));
    this.#cache.tick();
    const { gl } = this.#drawer;
    this.#seated &&= this.customLayers.size > 0 && gl !== null;
    const customLayers = this.#seated ? [...this.customLayers] : [];
    const combined = combinedOf(layers, this.#seated);
    const planned = layers.flatMap((layer) => {
      const plan = layer.plan(sight, light, kinds, combined.includes(layer));
      return plan ? [{ layer, plan }] : [];
    });
    const before = (layer: imageLayer): number | null => (combined.includes(layer) ? combined.indexOf(layer) : null);
    this.#queue.want(planned.flatMap(({ plan }) => plan.jobs));
    const complete = !layers.some((layer) => layer.loading) && planned.every(({ plan }) => plan.complete);
    if (turn && gl) turn({ gl, width, height, complete, getDepthRange: (frame) => rangeAlong(sight, frame, layers, customLayers), drawView: (camera, range, framebuffer) => { this.#depict({ ...sight, camera, dpr: 1 }, content, customLayers, { range, framebuffer }); } });
    else this.#drawer.draw({ camera: sight.camera, width, height, dpr: sight.dpr, light, customLayers, shade: shade && { by: shade, moving }, passes: planned.map(({ layer, plan }) => layer.pass(plan, sight, before(layer))) });
    if (complete && gl && this.customLayers.size > 0 && !this.#seated) {
      this.#seated = true;
      this.#events.changed();
    }
    return { plans: planned.map(({ plan }) => plan), complete: complete && !this.#drawer.busy };
  }

  /** What is in memory, with the depth of all layers that have any. */
  #depict(sight: ViewState, { layers, light, shade }: Content, customLayers: readonly CustomLayer[], into: NonNullable<FrameSpec["into"]>): void {
    const { camera } = sight;
    const { width, height } = camera;
    const passes = layers.filter((layer) => layer.combines).flatMap((layer, k) => {
      const plan = layer.plan(sight, light, [], true);
      return plan ? [layer.pass(plan, sight, k)] : [];
    });
    this.#drawer.draw({ camera, width, height, dpr: 1, light, customLayers, shade: shade && { by: shade, moving: false }, passes, into });
  }

  /** Forgets the tiles of a layer that has left. */
  forget(prefix: string): void {
    this.#cache.prune((key) => key.startsWith(prefix));
  }

  destroy(): void {
    clearTimeout(this.#waiting);
    this.#queue.want([]);
    this.#cache.prune(() => true);
    this.#decoder.stop();
    this.#drawer.destroy();
  }

  /** @throws DrawError */
  #open(kind: FilledOptions["drawer"]): Drawer {
    const { canvas } = this.#viewport;
    const events: DrawerEvents = {
      lost: () => { this.#lost(); },
      restored: () => { this.#restored(); },
      changed: () => { this.#events.changed(); },
      failed: (error) => { this.#events.failed(error); },
    };
    const preserve = this.#options.preserveDrawingBuffer;
    if (kind === "canvas") return new CanvasDrawer(canvas, preserve, events);
    try {
      return new WebGLDrawer(canvas, { preserve, quick: kind === "auto" }, events);
    } catch (reason) {
      if (kind === "webgl") throw reason;
      // A canvas that has tried WebGL gives nothing else.
      if (canvas.getContext("2d") === null) this.#viewport.replaceCanvas();
      return new CanvasDrawer(this.#viewport.canvas, preserve, events);
    }
  }

  #lost(): void {
    if (this.#options.drawer === "auto") this.#waiting ??= setTimeout(() => { this.#replace(); }, RESTORE_MS);
    this.#events.lost();
  }

  #restored(): void {
    clearTimeout(this.#waiting);
    this.#waiting = undefined;
    this.#refetch();
    this.#events.restored();
  }

  /** A canvas that had WebGL gives no 2D context: a fresh one takes its place. */
  #replace(): void {
    this.#drawer.destroy();
    this.#viewport.replaceCanvas();
    this.#drawer = this.#open("canvas");
    this.#refetch();
    this.#events.replaced();
  }

  /** Forgets the tiles that only the drawer had. */
  #refetch(): void {
    this.#cache.prune((_, { data, empty }) => data === null && !empty);
  }
}

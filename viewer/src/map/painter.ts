import type { Drawer } from "../draw/drawer";
import { WebGLDrawer } from "../draw/webgl/webglDrawer";
import type { Light } from "../geo/light";
import { Cache } from "../tiles/cache";
import { Decoder } from "../tiles/decoder";
import { Queue } from "../tiles/queue";
import type { Shared, Stored } from "../tiles/store";
import type { imageLayer } from "./imageLayer";
import type { LayerPlan } from "./layerPlan";
import type { FilledOptions } from "./options";
import type { Sight } from "./stage";
import type { Viewport } from "./viewport";

export interface PainterEvents {
  lost(): void;
  restored(): void;
}

export interface Painted {
  readonly plans: readonly LayerPlan[];
  /** Nothing is missing in view. */
  readonly complete: boolean;
}

/** Makes a frame: asks the layers what they want, fetches it, has it drawn. Owns tiles and drawer. */
export class Painter {
  readonly shared: Shared;
  readonly #viewport: Viewport;
  readonly #cache: Cache<Stored>;
  readonly #queue: Queue;
  readonly #decoder: Decoder;
  readonly #drawer: Drawer;

  /** @throws DrawError when the browser cannot draw */
  constructor(viewport: Viewport, options: FilledOptions, events: PainterEvents) {
    this.#viewport = viewport;
    this.#drawer = new WebGLDrawer(viewport.canvas, { preserve: options.preserveDrawingBuffer }, {
      lost: () => { events.lost(); },
      restored: () => {
        this.#cache.prune((_, { data, empty }) => data === null && !empty);
        events.restored();
      },
    });
    this.#cache = new Cache<Stored>(options.cacheBytes, (key, { data }) => {
      if (data?.kind === "color") data.bitmap.close();
      this.#drawer.release(key);
    });
    this.#queue = new Queue(options.concurrency);
    this.#decoder = new Decoder(options.workers);
    this.shared = { cache: this.#cache, queue: this.#queue, decoder: this.#decoder };
  }

  get busy(): boolean {
    return this.#queue.busy;
  }

  get cacheBytes(): number {
    return this.#cache.bytes;
  }

  paint(sight: Sight, layers: readonly imageLayer[], light: Readonly<Light>, hover: boolean): Painted {
    this.#cache.tick();
    this.#viewport.fitCanvas(sight.dpr);
    const planned = layers.flatMap((layer) => {
      const plan = layer.plan(sight, hover);
      return plan ? [{ layer, plan }] : [];
    });
    this.#queue.want(planned.flatMap(({ plan }) => plan.jobs));
    const { width, height } = this.#viewport.canvas;
    this.#drawer.draw({ width, height, dpr: sight.dpr, light, passes: planned.map(({ layer, plan }) => layer.pass(plan)) });
    const complete = layers.every((layer) => layer.rendering) && planned.every(({ plan }) => plan.complete);
    return { plans: planned.map(({ plan }) => plan), complete };
  }

  /** Forgets the tiles of a layer that has left. */
  forget(prefix: string): void {
    this.#cache.prune((key) => key.startsWith(prefix));
  }

  destroy(): void {
    this.#queue.want([]);
    this.#cache.prune(() => true);
    this.#decoder.stop();
    this.#drawer.destroy();
  }
}

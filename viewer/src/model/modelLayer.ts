import { prefersReducedMotion } from "../core/dom";
import { add, sub, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { MapLayer, FetchError, UsageError, type Map3D } from "../map3d";
import { readModelContents, disposeGpuResources, isSkinned, type ModelContents } from "./modelContents";
import { ModelRenderer, type SceneModel } from "./modelRenderer";
import type { ThreeAction, ThreeClip, ModelLoader, ThreeMixer, ThreeNode, Three } from "./threeTypes";

/** Options of `modelLayer`. */
export interface ModelLayerOptions {
  /** World position of the model's origin. */
  position: Vec3;
  /** Clockwise rotation, seen from above. At 0 the model's x axis points east, and its z axis (the front of a glTF) south. Default 0. */
  heading_deg?: number;
  /** Metres per unit of the model. Default 1. */
  scale?: number;
  /** The model's up axis; "y" in glTF. Default "y". */
  up?: "y" | "z";
  /** Loader for a URL, such as three.js's GLTFLoader: the class or an instance. `loadAsync` must return an Object3D or `{ scene, animations }`. Default: none, which suffices for a model without a URL. */
  loader?: ModelLoader | (new () => ModelLoader);
  /** Animations that play at once, by name; true for all. None play under `prefers-reduced-motion`. Default true. */
  play?: boolean | string | readonly string[];
}

/** Options of `play`. */
export interface PlayOptions {
  /** false plays once and stays at the end. Default true. */
  loop?: boolean;
}

/** A click on a model; `T` is the page's three.js. */
export interface ModelClick<T extends Three = Three> {
  /** CSS pixels. */
  readonly point: Vec2;
  /** World position on the model's surface. */
  readonly position: Vec3;
  /** The part of the model that was hit. */
  readonly object: InstanceType<T["Object3D"]>;
  /** Result of three.js's Raycaster, in coordinates relative to the scene's origin. */
  readonly intersection: ReturnType<InstanceType<T["Raycaster"]>["intersectObjects"]>[number];
}

/** Events of `modelLayer`. */
export interface ModelLayerEvents<T extends Three = Three> {
  /** The model is on the map. */
  ready: { object: InstanceType<T["Object3D"]>; clips: readonly string[] };
  /** The visible part of the model was clicked or tapped. The map's own "click" still reports the images there. */
  click: ModelClick<T>;
  /** The model cannot be loaded or drawn. The map fires "error", too. */
  error: { error: Error };
}

/** A URL, an Object3D, or the result of GLTFLoader. */
export type ModelSource<T extends Three> =
  string | InstanceType<T["Object3D"]> | { readonly scene: InstanceType<T["Object3D"]>; readonly animations?: readonly ThreeClip[] };

/** First release of three.js with the light units that are used here. */
const MIN_REVISION = 155;
const RAD = Math.PI / 180;

/** A 3D model between the images: buildings hide it, it hides buildings, and the map's light lights it. The page passes in its own three.js, which draws it. */
export class ModelLayer<T extends Three = Three> extends MapLayer<Map3D, ModelLayerEvents<T>> {
  readonly needs = ["depth"] as const;
  readonly options: Readonly<ModelLayerOptions>;
  readonly #three: Three;
  readonly #source: ModelSource<T>;
  readonly #pivot: ThreeNode;
  #position: Vec3;
  #heading_deg: number;
  #scale: number;
  #loading: Promise<ModelContents> | undefined;
  #contents: ModelContents | undefined;
  #mixer: ThreeMixer | undefined;
  #actions: ThreeAction[] = [];
  /** Animations to play once the model is loaded. */
  #pending: { names: readonly string[]; loop: boolean } | null = null;
  #skinned = false;
  readonly #sceneModel: SceneModel;

  /** @param three the page's three.js, r155 or newer  @param source a URL, an Object3D, or the result of GLTFLoader  @throws UsageError */
  constructor(three: T, source: ModelSource<T>, options: ModelLayerOptions) {
    super();
    if (!(parseInt(three.REVISION) >= MIN_REVISION))
      throw new UsageError(
        `a modelLayer needs three.js r${MIN_REVISION} or newer, got ${three.REVISION ? `r${three.REVISION}` : typeof three}`,
      );
    if (typeof source === "string" && !options.loader)
      throw new UsageError(`a modelLayer needs a loader for "${source}", e.g. { loader: GLTFLoader }`);
    this.#three = three;
    this.#source = source;
    this.options = options;
    this.#position = checkPosition(options.position);
    this.#heading_deg = checkNumber(options.heading_deg ?? 0, "heading_deg");
    this.#scale = checkScale(options.scale ?? 1);
    const { play = true } = options;
    if (play !== false && !prefersReducedMotion()) this.#pending = { names: play === true ? [] : [play].flat(), loop: true };
    this.#pivot = new three.Group();
    this.#sceneModel = this.#createSceneModel();
  }

  /** The model's Object3D; call `redraw` after changing it. null before "ready". */
  get object(): InstanceType<T["Object3D"]> | null {
    return (this.#contents?.object as InstanceType<T["Object3D"]> | undefined) ?? null;
  }

  /** Names of its animations; empty before "ready". */
  get clips(): readonly string[] {
    return this.#contents?.clips.map(({ name }) => name) ?? [];
  }

  /** World position of the model's origin. */
  get position(): Vec3 {
    return this.#position;
  }

  /** Clockwise rotation. */
  get heading_deg(): number {
    return this.#heading_deg;
  }

  /** Metres per unit of the model. */
  get scale(): number {
    return this.#scale;
  }

  /** True while an animation plays. */
  get playing(): boolean {
    return this.#actions.some((action) => action.isRunning());
  }

  /** Bounding box, world coordinates, for `fitBounds`; null before "ready". */
  get bounds(): Box3 | null {
    const [box] = this.#boxes(this.#position);
    return box ? [add(this.#position, box[0]), add(this.#position, box[1])] : null;
  }

  /** Moves the model. @throws UsageError unless the position is three numbers */
  setPosition(position: Vec3): this {
    this.#position = checkPosition(position);
    return this.redraw();
  }

  /** Rotates the model. @throws UsageError unless the heading is a number */
  setHeading(heading_deg: number): this {
    this.#heading_deg = checkNumber(heading_deg, "heading_deg");
    return this.redraw();
  }

  /** Scales the model. @throws UsageError unless the scale is greater than 0 */
  setScale(scale: number): this {
    this.#scale = checkScale(scale);
    return this.redraw();
  }

  /** Plays animations; all of them without names. Before "ready", they play once the model is loaded. @throws UsageError for an unknown name */
  play(names: string | readonly string[] = [], { loop = true }: PlayOptions = {}): this {
    const pending = { names: [names].flat(), loop };
    if (this.#contents) this.#playClips(this.#contents, pending);
    else this.#pending = pending;
    return this.redraw();
  }

  /** Stops all animations and resets the model to its initial pose. */
  stop(): this {
    this.#pending = null;
    for (const action of this.#actions.splice(0)) action.stop();
    return this.redraw();
  }

  /** Redraws the map after changes to `object`. */
  redraw(): this {
    this.map?.layerContext?.requestFrame();
    return this;
  }

  protected onAdd(map: Map3D): void {
    this.#start(map).catch((reason: unknown) => {
      if (this.map === map) this.#fail(map, reason instanceof Error ? reason : new Error(String(reason)));
    });
  }

  protected onRemove(map: Map3D): void {
    if (this.#contents) disposeGpuResources(this.#contents.object); // before the renderer is disposed of, which knows its GPU resources
    ModelRenderer.remove(map, this.#three, this.#sceneModel);
  }

  async #start(map: Map3D): Promise<void> {
    if (map.drawer === null) return; // the map has reported the error
    this.#loading ??= this.#load();
    const contents = await this.#loading.catch((reason: unknown) => {
      this.#loading = undefined; // adding the layer again retries
      throw reason;
    });
    // A lost context cannot create resources.
    if (map.canvas.getContext("webgl2")?.isContextLost())
      await new Promise<void>((resolve) => map.once("contextrestored", () => resolve()));
    if (this.map !== map) return;
    this.#contents ??= this.#addToPivot(contents);
    ModelRenderer.add(map, this.#three, this.#sceneModel);
    map.layerContext?.requestFrame();
    this.fire("ready", { object: contents.object as InstanceType<T["Object3D"]>, clips: this.clips });
    const pending = this.#pending;
    this.#pending = null;
    if (pending) this.#playClips(contents, pending);
  }

  async #load(): Promise<ModelContents> {
    const source = this.#source;
    const { loader } = this.options;
    if (typeof source !== "string" || !loader) return readModelContents(source, "the source of a modelLayer");
    const reader = typeof loader === "function" ? new loader() : loader;
    const loaded = await reader.loadAsync(source).catch((reason: unknown) => {
      throw new FetchError(
        `${source}: ${reason instanceof Error ? reason.message : String(reason)}`,
        (reason as { response?: Response } | null)?.response?.status,
      );
    });
    return readModelContents(loaded, source);
  }

  #addToPivot(contents: ModelContents): ModelContents {
    this.#pivot.add(contents.object);
    contents.object.traverse((node) => (this.#skinned ||= isSkinned(node)));
    return contents;
  }

  #playClips({ object, clips }: ModelContents, { names, loop }: { names: readonly string[]; loop: boolean }): void {
    const unknown = names.find((name) => !clips.some((clip) => clip.name === name));
    if (unknown !== undefined)
      throw new UsageError(`unknown animation "${unknown}"; the model has ${clips.map(({ name }) => `"${name}"`).join(", ") || "none"}`);
    const mixer = (this.#mixer ??= new this.#three.AnimationMixer(object as never));
    for (const clip of clips.filter(({ name }) => names.length === 0 || names.includes(name))) {
      const action = mixer.clipAction(clip);
      action.clampWhenFinished = true;
      action
        .reset()
        .setLoop((loop ? this.#three.LoopRepeat : this.#three.LoopOnce) as never, Infinity)
        .play();
      if (!this.#actions.includes(action)) this.#actions.push(action);
    }
    this.redraw();
  }

  #fail(map: Map3D, error: Error): void {
    this.fire("error", { error });
    map.layerContext?.report(error);
  }

  #createSceneModel(): SceneModel {
    const listening = (): boolean => this.listens("click");
    return {
      pivot: this.#pivot,
      get listening() {
        return listening();
      },
      boxes: (origin) => this.#boxes(origin),
      step: (seconds) => {
        if (!this.playing) return false;
        this.#mixer?.update(seconds);
        return true;
      },
      clicked: (point, position, hit) => {
        this.fire("click", { point, position, object: hit.object as InstanceType<T["Object3D"]>, intersection: hit });
      },
      failed: (error) => {
        if (this.map) this.#fail(this.map, error);
      },
    };
  }

  /** Places the model relative to an origin (world) and returns its local bounding box, none before "ready". The box of a skinned mesh is enlarged by its own size on all sides. */
  #boxes(origin: Vec3): Box3[] {
    if (!this.#contents) return [];
    this.#pivot.position.set(...sub(this.#position, origin));
    this.#pivot.rotation.set(this.options.up === "z" ? 0 : 90 * RAD, 0, -this.#heading_deg * RAD, "ZYX");
    this.#pivot.scale.set(this.#scale, this.#scale, this.#scale);
    const box = new this.#three.Box3();
    box.setFromObject(this.#pivot);
    if (box.isEmpty()) return [];
    const [low, high]: Box3 = [
      [box.min.x, box.min.y, box.min.z],
      [box.max.x, box.max.y, box.max.z],
    ];
    const size = this.#skinned ? sub(high, low) : ([0, 0, 0] as const);
    return [[sub(low, size), add(high, size)]];
  }
}

function checkNumber(value: number, name: string): number {
  if (!Number.isFinite(value)) throw new UsageError(`${name} must be a number, got ${String(value)}`);
  return value;
}

function checkScale(scale: number): number {
  if (!(checkNumber(scale, "scale") > 0)) throw new UsageError(`scale must be greater than 0, got ${scale}`);
  return scale;
}

function checkPosition(position: Vec3): Vec3 {
  const [x, y, z] = position;
  return [checkNumber(x, "position x"), checkNumber(y, "position y"), checkNumber(z, "position z")];
}

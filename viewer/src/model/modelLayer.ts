import { add, sub, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { MapLayer, FetchError, UsageError, type map } from "../map3d";
import { contentsOf, freed, isBoned, type Contents } from "./contents";
import { Models, type Member } from "./models";
import type { Action, ThreeClip, ModelLoader, Mixer, ThreeNode, Three } from "./three";

/** How a model begins. */
export interface ModelLayerOptions {
  /** Where its own origin stands: world coordinates. */
  position: Vec3;
  /** By how much it is turned clockwise, seen from above. At 0 its x points to the east, and its z, where the front of a glTF is, to the south. Default 0. */
  heading_deg?: number;
  /** Metres a unit of it. Default 1. */
  scale?: number;
  /** Its axis that points to the sky: glTF has "y". Default "y". */
  up?: "y" | "z";
  /** What reads the file, e.g. three.js's GLTFLoader: the class, or one of it. Any loader whose `loadAsync` gives an Object3D, or `{ scene, animations }`. */
  loader?: ModelLoader | (new () => ModelLoader);
  /** Clips that play from the beginning, by name; true: all, unless the reader wants no movement. Default true. */
  play?: boolean | string | readonly string[];
}

/** Of `play`. */
export interface PlayOptions {
  /** false: once, and stays as it ends. Default true. */
  loop?: boolean;
}

/** A click on a model; `T` is the page's three.js. */
export interface ModelClick<T extends Three = Three> {
  /** CSS pixels. */
  readonly point: Vec2;
  /** World position on the model's surface. */
  readonly position: Vec3;
  /** What of the model was hit. */
  readonly object: InstanceType<T["Object3D"]>;
  /** As three.js's Raycaster gives it; its numbers are local, from the scene's origin. */
  readonly intersection: ReturnType<InstanceType<T["Raycaster"]>["intersectObjects"]>[number];
}

/** What a modelLayer fires. */
export interface ModelLayerEvents<T extends Three = Three> {
  /** The model is on the map. */
  ready: { object: InstanceType<T["Object3D"]>; clips: readonly string[] };
  /** Clicked or tapped where nothing stands before it. The map's own "click" tells, as ever, of the images there. */
  click: ModelClick<T>;
  /** The map's "error" says so, too. */
  error: { error: Error };
}

export type ModelSource<T extends Three> = string | InstanceType<T["Object3D"]> | { readonly scene: InstanceType<T["Object3D"]>; readonly animations?: readonly ThreeClip[] };

/** three.js's lights count in today's units from here on. */
const OLDEST = 155;
const RAD = Math.PI / 180;

const still = (): boolean => matchMedia("(prefers-reduced-motion: reduce)").matches;

/** A polygonal object among the images: hidden by what stands before it, lit by the map's light. The page hands in its own three.js, which draws it. */
export class modelLayer<T extends Three = Three> extends MapLayer<map, ModelLayerEvents<T>> {
  readonly needs = ["depth"] as const;
  readonly options: Readonly<ModelLayerOptions>;
  readonly #three: Three;
  readonly #source: ModelSource<T>;
  readonly #pivot: ThreeNode;
  #position: Vec3;
  #heading_deg: number;
  #scale: number;
  #loading: Promise<Contents> | undefined;
  #contents: Contents | undefined;
  #mixer: Mixer | undefined;
  #actions: Action[] = [];
  /** What plays as soon as it is here. */
  #wanted: { names: readonly string[]; loop: boolean } | null = null;
  #boned = false;
  readonly #member: Member;

  /** @param three the page's three.js, r155 or newer  @param source where a model is to be fetched, an Object3D, or what GLTFLoader made  @throws UsageError */
  constructor(three: T, source: ModelSource<T>, options: ModelLayerOptions) {
    super();
    if (!(parseInt(three.REVISION) >= OLDEST)) throw new UsageError(`a modelLayer needs three.js r${OLDEST} or newer, got ${three.REVISION ? `r${three.REVISION}` : typeof three}`);
    if (typeof source === "string" && !options.loader) throw new UsageError(`a modelLayer that fetches "${source}" needs a loader, e.g. { loader: GLTFLoader }`);
    this.#three = three;
    this.#source = source;
    this.options = options;
    this.#position = checkedPosition(options.position);
    this.#heading_deg = checked(options.heading_deg ?? 0, "heading_deg");
    this.#scale = checkedScale(options.scale ?? 1);
    const { play = true } = options;
    if (play !== false && !still()) this.#wanted = { names: play === true ? [] : [play].flat(), loop: true };
    this.#pivot = new three.Group();
    this.#member = this.#made();
  }

  /** What stands in the scene; change it as three.js has it, then call `redraw`. null before "ready". */
  get object(): InstanceType<T["Object3D"]> | null {
    return (this.#contents?.object as InstanceType<T["Object3D"]> | undefined) ?? null;
  }

  /** Names of its animations; none before "ready". */
  get clips(): readonly string[] {
    return this.#contents?.clips.map(({ name }) => name) ?? [];
  }

  /** World coordinates. */
  get position(): Vec3 {
    return this.#position;
  }

  /** Degrees clockwise. */
  get heading_deg(): number {
    return this.#heading_deg;
  }

  /** Metres a unit of the model. */
  get scale(): number {
    return this.#scale;
  }

  /** Is one of its animations under way? */
  get playing(): boolean {
    return this.#actions.some((action) => action.isRunning());
  }

  /** Box around it, world coordinates, for fitBounds; null before "ready". */
  get bounds(): Box3 | null {
    const [box] = this.#boxes(this.#position);
    return box ? [add(this.#position, box[0]), add(this.#position, box[1])] : null;
  }

  /** World coordinates. @throws UsageError for what are no three numbers */
  setPosition(position: Vec3): this {
    this.#position = checkedPosition(position);
    return this.redraw();
  }

  /** Degrees clockwise. @throws UsageError for what is no number */
  setHeading(heading_deg: number): this {
    this.#heading_deg = checked(heading_deg, "heading_deg");
    return this.redraw();
  }

  /** Metres a unit of the model. @throws UsageError unless it is above 0 */
  setScale(scale: number): this {
    this.#scale = checkedScale(scale);
    return this.redraw();
  }

  /** Plays animations; without names all of them. Before "ready" it waits. @throws UsageError for a name that it does not have */
  play(names: string | readonly string[] = [], { loop = true }: PlayOptions = {}): this {
    const wanted = { names: [names].flat(), loop };
    if (this.#contents) this.#start(this.#contents, wanted);
    else this.#wanted = wanted;
    return this.redraw();
  }

  /** Ends all animations; the model stands as before them. */
  stop(): this {
    this.#wanted = null;
    for (const action of this.#actions.splice(0)) action.stop();
    return this.redraw();
  }

  /** Shows what the page has changed of `object`. */
  redraw(): this {
    this.map?.layerContext?.requestFrame();
    return this;
  }

  protected onAdd(map: map): void {
    this.#begin(map).catch((reason: unknown) => {
      if (this.map === map) this.#fail(map, reason instanceof Error ? reason : new Error(String(reason)));
    });
  }

  protected onRemove(map: map): void {
    if (this.#contents) freed(this.#contents.object); // while the renderer still knows what it has of it
    Models.remove(map, this.#three, this.#member);
  }

  async #begin(map: map): Promise<void> {
    if (map.drawer === null) return; // the map has said why
    this.#loading ??= this.#load();
    const contents = await this.#loading.catch((reason: unknown) => {
      this.#loading = undefined; // put on a map again, it is tried again
      throw reason;
    });
    // A context that is lost makes nothing.
    if (map.canvas.getContext("webgl2")?.isContextLost()) await new Promise<void>((back) => map.once("contextrestored", () => { back(); }));
    if (this.map !== map) return;
    this.#contents ??= this.#placed(contents);
    Models.add(map, this.#three, this.#member);
    map.layerContext?.requestFrame();
    this.fire("ready", { object: contents.object as InstanceType<T["Object3D"]>, clips: this.clips });
    const wanted = this.#wanted;
    this.#wanted = null;
    if (wanted) this.#start(contents, wanted);
  }

  async #load(): Promise<Contents> {
    const source = this.#source;
    const { loader } = this.options;
    if (typeof source !== "string" || !loader) return contentsOf(source, "the source of a modelLayer");
    const reader = typeof loader === "function" ? new loader() : loader;
    const made = await reader.loadAsync(source).catch((reason: unknown) => {
      throw new FetchError(`${source}: ${reason instanceof Error ? reason.message : String(reason)}`, (reason as { response?: Response } | null)?.response?.status);
    });
    return contentsOf(made, source);
  }

  #placed(contents: Contents): Contents {
    this.#pivot.add(contents.object);
    contents.object.traverse((node) => (this.#boned ||= isBoned(node)));
    return contents;
  }

  #start({ object, clips }: Contents, { names, loop }: { names: readonly string[]; loop: boolean }): void {
    const unknown = names.find((name) => !clips.some((clip) => clip.name === name));
    if (unknown !== undefined) throw new UsageError(`animation "${unknown}" is none of ${clips.map(({ name }) => `"${name}"`).join(", ") || "none"}`);
    const mixer = (this.#mixer ??= new this.#three.AnimationMixer(object as never));
    for (const clip of clips.filter(({ name }) => names.length === 0 || names.includes(name))) {
      const action = mixer.clipAction(clip);
      action.clampWhenFinished = true;
      action.reset().setLoop((loop ? this.#three.LoopRepeat : this.#three.LoopOnce) as never, Infinity).play();
      if (!this.#actions.includes(action)) this.#actions.push(action);
    }
    this.redraw();
  }

  #fail(map: map, error: Error): void {
    this.fire("error", { error });
    map.layerContext?.report(error);
  }

  #made(): Member {
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

  /** Places the model by an origin (world) and measures it: local boxes, none before "ready". What bones move may be as large again to all sides. */
  #boxes(origin: Vec3): Box3[] {
    if (!this.#contents) return [];
    this.#pivot.position.set(...sub(this.#position, origin));
    this.#pivot.rotation.set(this.options.up === "z" ? 0 : 90 * RAD, 0, -this.#heading_deg * RAD, "ZYX");
    this.#pivot.scale.set(this.#scale, this.#scale, this.#scale);
    const box = new this.#three.Box3();
    box.setFromObject(this.#pivot);
    if (box.isEmpty()) return [];
    const [low, high]: Box3 = [[box.min.x, box.min.y, box.min.z], [box.max.x, box.max.y, box.max.z]];
    const size = this.#boned ? sub(high, low) : ([0, 0, 0] as const);
    return [[sub(low, size), add(high, size)]];
  }
}

function checked(value: number, name: string): number {
  if (!Number.isFinite(value)) throw new UsageError(`${name} is to be a number, got ${String(value)}`);
  return value;
}

function checkedScale(scale: number): number {
  if (!(checked(scale, "scale") > 0)) throw new UsageError(`scale is to be above 0, got ${scale}`);
  return scale;
}

function checkedPosition(position: Vec3): Vec3 {
  const [x, y, z] = position;
  return [checked(x, "position x"), checked(y, "position y"), checked(z, "position z")];
}

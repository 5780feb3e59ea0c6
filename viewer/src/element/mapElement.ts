import { map, type Addable, type imageLayer, type Light, type MapEvents, type MapOptions, type Vec3 } from "../map3d";
import { isOn, light, number, PageElement, position, time, words } from "./attributes";
import { Frame } from "./frame";
import { followLayer, layerOf } from "./layerElement";
import type { part, Place } from "./part";

/** The map's events as the element fires them: `map-click`, `map-ready`, …, with the event's fields as `detail`. They bubble. */
export type MapElementEvents = { [K in keyof MapEvents as `map-${K}`]: CustomEvent<MapEvents[K]> };

type Tell = <K extends keyof MapEvents>(type: K, fields: MapEvents[K]) => void;

/** What a map looked like when it ended, for the one that comes after; attributes that have changed since go before. */
interface Left {
  center?: Vec3 | undefined;
  zoom?: number | undefined;
  direction?: string | undefined;
  light?: Partial<Light> | undefined;
  time?: Date | undefined;
}

/** Attributes that a map keeps from its making on. */
const MAKING: ReadonlySet<string> = new Set(["src", "language", "label", "controls", "attribution", "drawer", "hover"]);
/** Attributes that are followed at once. */
const FOLLOWED = ["direction", "center", "zoom", "light", "time", "mode", "opacity", "background"];

/** A map that tells its element of all that it fires. */
class toldMap extends map {
  readonly tell: Tell | undefined;

  constructor(target: HTMLElement, options: MapOptions, tell: Tell) {
    super(target, options);
    this.tell = tell;
  }

  override fire<K extends keyof MapEvents>(type: K, fields: MapEvents[K]): this {
    super.fire(type, fields);
    this.tell?.(type, fields);
    return this;
  }

  override listens(type: keyof MapEvents): boolean {
    return type === "error" || (type === "mousemove" && this.options.hover) || super.listens(type);
  }
}

/**
 * `<map-3d src="…">`: a map as an element. Its height is the style sheet's, 24rem unless given. Inside it: `<map-3d-layer>`, `<map-3d-marker>`, and a sentence
 * that is shown where nothing can be drawn. Attributes can change at any time; what they cannot mean is an event `map-error`, and ignored.
 */
export class mapElement extends PageElement implements Place {
  /** @internal */
  static readonly observedAttributes: readonly string[] = [...MAKING, ...FOLLOWED];
  #frame: Frame | undefined;
  #map: map | null = null;
  #base: imageLayer | null = null;
  #failed = new WeakSet<imageLayer>();
  #drawn = false;
  /** The map has a view. */
  #ready = false;
  /** A new map is to be made, once the script that changes attributes has ended. */
  #stale = false;
  /** Another rendering is to be shown: the view of the one before says nothing. */
  #other = false;
  #left: Left = {};

  /** null while the element is not in the page. */
  get map(): map | null {
    return this.#map;
  }

  /** That of `src` first, then those of `<map-3d-layer>`, then those that scripts have added. */
  get layers(): readonly imageLayer[] {
    return this.#map?.layers ?? [];
  }

  /** A picture is seen or to come; else what stands inside the element is shown. */
  get drawn(): boolean {
    return this.#drawn;
  }

  /** @internal */
  connectedCallback(): void {
    if (!this.#map) this.#begin();
  }

  /** @internal The map stays when the element is only put elsewhere. */
  disconnectedCallback(): void {
    queueMicrotask(() => {
      if (!this.isConnected) this.#end();
    });
  }

  /** @internal */
  attributeChangedCallback(name: string): void {
    if (name === "src") this.#other = true;
    if (!this.#map) this.#left = { ...this.#left, [name]: undefined, ...(name === "light" && { time: undefined }) };
    else if (MAKING.has(name)) this.#renewSoon();
    else if (this.#ready) this.#try(() => { this.#follow(name); });
    else this.#renewSoon();
  }

  /** @internal */
  report(reason: unknown): void {
    this.#tell("error", { error: reason instanceof Error ? reason : new Error(String(reason)) });
  }

  /** @internal */
  watch(layer: imageLayer): void {
    layer.on("error", () => {
      if (!layer.rendering) this.#failed.add(layer);
      this.#judge();
    });
    layer.on("ready", () => {
      this.#failed.delete(layer);
      this.#judge();
    });
    this.#judge();
  }

  // The map's life

  #begin(): void {
    if (this.#other) this.#left = {};
    this.#other = false;
    this.#frame ??= new Frame(this);
    const options = this.#options();
    this.#map = new toldMap(this.#frame.lay(options.language), options, this.#tell);
    if (words(this, "src").length > 0) this.#try(() => { this.#base = layerOf(this); });
    if (this.#base) this.#map.add(this.#base);
    if (this.#base) this.watch(this.#base);
    for (const each of this.#parts("map-3d-layer")) each.enter(this);
    this.#judge();
  }

  #end(): void {
    const ended = this.#map;
    if (!ended) return;
    if (this.#ready) this.#left = { center: ended.center ?? undefined, zoom: ended.zoom, direction: ended.direction, light: ended.light, time: ended.time ?? undefined };
    for (const each of this.#parts("map-3d-layer, map-3d-marker")) each.leave();
    ended.remove();
    this.#frame?.clear();
    this.#map = this.#base = null;
    this.#ready = this.#drawn = false;
  }

  #renewSoon(): void {
    if (this.#stale) return;
    this.#stale = true;
    queueMicrotask(() => {
      this.#stale = false;
      if (!this.#map) return;
      this.#end();
      this.#begin();
    });
  }

  /** Shows the map, or what stands in for it; then what markers have inside is a part of that. */
  #judge(): void {
    const map = this.#map;
    if (!map) return;
    const before = this.#drawn;
    this.#drawn = map.drawer !== null && map.layers.some((layer) => !this.#failed.has(layer));
    if (this.#drawn !== before) for (const each of this.#parts("map-3d-marker")) each.enter(this);
    this.#frame?.show(this.#drawn, map.language);
  }

  /** Those that are registered already; the others come by themselves. */
  #parts(selector: string): part<Addable<map>>[] {
    return [...this.querySelectorAll<part<Addable<map>>>(selector)].filter((element) => "enter" in element);
  }

  // Attributes

  #options(): MapOptions {
    const left = this.#left;
    const [language, drawer, background] = ["language", "drawer", "background"].map((name) => this.getAttribute(name) ?? undefined);
    const all = {
      center: left.center ?? this.#try(() => position(this, "center")),
      zoom: left.zoom ?? this.#try(() => number(this, "zoom")),
      direction: left.direction ?? this.getAttribute("direction") ?? undefined,
      light: left.light ?? this.#try(() => light(this)),
      drawer: drawer as MapOptions["drawer"],
      controls: isOn(this, "controls"),
      attribution: isOn(this, "attribution"),
      hover: isOn(this, "hover"),
      language,
      background,
    };
    return Object.fromEntries(Object.entries(all).filter(([, value]) => value !== undefined));
  }

  /** Brings an attribute's new value to the map; one that was taken away changes nothing, except that of a layer. @throws UsageError */
  #follow(name: string): void {
    const map = this.#map as map;
    const value = this.getAttribute(name);
    if (this.#base && (name === "mode" || name === "opacity")) followLayer(this, this.#base, name);
    else if (value === null) return;
    else if (name === "direction") map.setDirection(value);
    else if (name === "background") map.setBackground(value);
    else if (name === "zoom") map.setZoom(number(this, name) ?? map.zoom);
    else if (name === "center") given(position(this, name), (center) => map.setView(center));
    else if (name === "light") given(light(this), (part) => map.setLight(part));
    else if (name === "time") given(time(this), (moment) => map.setTime(moment));
  }

  #try<T>(act: () => T): T | undefined {
    try {
      return act();
    } catch (reason) {
      this.report(reason);
      return undefined;
    }
  }

  // Events

  readonly #tell: Tell = (type, fields) => {
    if (type === "ready") this.#begun();
    const event = new CustomEvent(`map-${type}`, { detail: fields, bubbles: true, composed: true, cancelable: type === "error" });
    const quiet = !this.dispatchEvent(event);
    if ("error" in fields && !quiet) console.warn(`map3d: ${fields.error.message}`);
  };

  /** The map has a view. Light of a moment needs to know where on earth that is. */
  #begun(): void {
    this.#ready = true;
    const { light: lit, time: moment } = this.#left;
    if (moment) this.#try(() => this.#map?.setTime(moment));
    else if (!lit) this.#try(() => { this.#follow("time"); });
    this.#left = {};
    this.#judge();
  }
}

const given = <T>(value: T | undefined, act: (value: T) => unknown): void => {
  if (value !== undefined) act(value);
};

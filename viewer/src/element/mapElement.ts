import {
  plugins,
  getPlugin,
  Map3D,
  type Addable,
  type AnyPosition,
  type ImageLayer,
  type Light,
  type MapEvents,
  type MapOptions,
} from "../map3d";
import { findFirstSun } from "../geo/firstSun";
import { isOn, light, number, PageElement, place, time, words } from "./attributes";
import { ElementContent } from "./elementContent";
import { updateLayer, createLayer } from "./layerElement";
import type { Part, ElementHost } from "./part";
import { showThumbnail } from "./thumbnail";

/** Events of the element: the map's events with the prefix `map-` and their fields in `detail`. They bubble. */
export type MapElementEvents = { [K in keyof MapEvents as `map-${K}`]: CustomEvent<MapEvents[K]> };

type FireEvent = <K extends keyof MapEvents>(type: K, fields: MapEvents[K]) => void;

/** State of a removed map, restored by the next one. Attributes that change in between take precedence. */
interface SavedState {
  center?: AnyPosition | undefined;
  zoom?: number | undefined;
  direction?: string | undefined;
  light?: Partial<Light> | undefined;
  time?: Date | undefined;
}

/** Attributes that add an entry of the same name to the map. */
const PLUGINS = ["orbit", "shade"];
/** An attribute that is an option of the map: how it is read, and how a change is applied; without that, a change creates a new map. */
interface OptionAttribute<T> {
  /** @throws UsageError */
  readonly read: (element: Element) => T | undefined;
  readonly apply?: (map: Map3D, value: T) => unknown;
}

type OptionAttributes = { readonly [K in keyof MapOptions]?: OptionAttribute<NonNullable<MapOptions[K]>> };

const text =
  (name: string) =>
  (element: Element): string | undefined =>
    element.getAttribute(name) ?? undefined;

/** The options of the map that are attributes of the same name; `lonlat` is another name of `center`. */
const OPTIONS: OptionAttributes = {
  center: { read: (element) => place(element, "center"), apply: (map, center) => map.setView(center) },
  zoom: { read: (element) => number(element, "zoom"), apply: (map, zoom) => map.setZoom(zoom) },
  direction: { read: text("direction"), apply: (map, direction) => map.setDirection(direction) },
  light: { read: light, apply: (map, part) => map.setLight(part) },
  background: { read: text("background"), apply: (map, background) => map.setBackground(background) },
  drawer: { read: text("drawer") as OptionAttribute<NonNullable<MapOptions["drawer"]>>["read"] },
  controls: { read: (element) => isOn(element, "controls") },
  attribution: { read: (element) => isOn(element, "attribution") },
  hover: { read: (element) => isOn(element, "hover") },
  gestureHandling: { read: text("gesturehandling") as OptionAttribute<NonNullable<MapOptions["gestureHandling"]>>["read"] },
  language: { read: text("language") },
};
const OPTION_ROWS = Object.entries(OPTIONS) as [keyof MapOptions, OptionAttribute<unknown>][];

/** Changes of these attributes create a new map. */
const RECREATING: ReadonlySet<string> = new Set([
  "src",
  "label",
  ...PLUGINS,
  ...OPTION_ROWS.flatMap(([name, { apply }]) => (apply ? [] : [name.toLowerCase()])),
]);
/** Changes of these attributes are applied to the map. */
const APPLIED = ["lonlat", "time", "mode", "opacity", ...OPTION_ROWS.flatMap(([name, { apply }]) => (apply ? [name] : []))];

/** A map that forwards its events to its element. */
class ForwardingMap extends Map3D {
  readonly forward: FireEvent | undefined;

  constructor(target: HTMLElement, options: MapOptions, forward: FireEvent) {
    super(target, options);
    this.forward = forward;
  }

  override fire<K extends keyof MapEvents>(type: K, fields: MapEvents[K]): this {
    super.fire(type, fields);
    this.forward?.(type, fields);
    return this;
  }

  override listens(type: keyof MapEvents): boolean {
    return type === "error" || (type === "mousemove" && this.options.hover) || super.listens(type);
  }
}

/**
 * `<map-3d src="…">`: a map as an element, 24rem high unless a style sheet sets its height. It can contain `<map-3d-layer>`, `<map-3d-marker>` and fallback
 * content, which is shown when no map can be drawn. Attributes can change at any time; an invalid value fires `map-error` and is ignored.
 */
export class MapElement extends PageElement implements ElementHost {
  /** @internal */
  static readonly observedAttributes: readonly string[] = [...RECREATING, ...APPLIED];
  #content: ElementContent | undefined;
  #map: Map3D | null = null;
  #base: ImageLayer | null = null;
  #failed = new WeakSet<ImageLayer>();
  readonly #added = new Set<string>();
  #drawn = false;
  /** True once the map has a view. */
  #ready = false;
  /** A new map is created after the current script, which may change more attributes. */
  #renewScheduled = false;
  /** `src` has changed, so the saved view does not apply. */
  #srcChanged = false;
  #saved: SavedState = {};

  /** The map; null while the element is not in the page. */
  get map(): Map3D | null {
    return this.#map;
  }

  /** The layer of `src`, then those of `<map-3d-layer>`, then those that scripts have added. */
  get layers(): readonly ImageLayer[] {
    return this.#map?.layers ?? [];
  }

  /** True while the map is shown, false while the fallback content is. */
  get drawn(): boolean {
    return this.#drawn;
  }

  /** @internal */
  connectedCallback(): void {
    if (!this.#map) this.#create();
  }

  /** @internal Keeps the map when the element is only moved. */
  disconnectedCallback(): void {
    queueMicrotask(() => {
      if (!this.isConnected) this.#destroy();
    });
  }

  /** @internal */
  attributeChangedCallback(name: string): void {
    if (name === "src") this.#srcChanged = true;
    if (!this.#map) this.#saved = { ...this.#saved, [name]: undefined, ...(name === "light" && { time: undefined }) };
    else if (RECREATING.has(name)) this.#scheduleRenew();
    else if (this.#ready) this.#try(() => this.#apply(name));
    else this.#scheduleRenew();
  }

  /** @internal */
  report(reason: unknown): void {
    this.#dispatch("error", { error: reason instanceof Error ? reason : new Error(String(reason)) });
  }

  /** @internal */
  watch(layer: ImageLayer): void {
    layer.on("error", () => {
      if (!layer.rendering) this.#failed.add(layer);
      this.#updateContent();
    });
    layer.on("ready", () => {
      this.#failed.delete(layer);
      this.#updateContent();
    });
    this.#updateContent();
  }

  // Lifecycle

  #create(): void {
    if (this.#srcChanged) this.#saved = {};
    this.#srcChanged = false;
    this.#content ??= new ElementContent(this);
    const options = this.#options();
    const map = new ForwardingMap(this.#content.createContainer(options.language), options, this.#dispatch);
    this.#map = map;
    const base = words(this, "src").length > 0 && this.#try(() => createLayer(this));
    if (base) {
      this.#base = base.addTo(map);
      this.watch(base);
      showThumbnail(map, base);
    }
    for (const each of this.#parts("map-3d-layer")) each.enter(this);
    this.#updateContent();
    this.#addPlugins();
  }

  /** Adds the entries that attributes ask for, as soon as their scripts have run. */
  #addPlugins(): void {
    for (const name of PLUGINS.filter((each) => isOn(this, each) && !this.#added.has(each))) {
      if (!(name in plugins) && document.readyState !== "complete") {
        window.addEventListener("load", () => this.#addPlugins(), { once: true });
        return;
      }
      this.#try(() => this.#map?.add(new (getPlugin(name, `<map-3d ${name}>`) as new () => Addable<Map3D>)()));
      this.#added.add(name);
    }
  }

  #destroy(): void {
    const map = this.#map;
    if (!map) return;
    if (this.#ready)
      this.#saved = {
        center: map.center ?? undefined,
        zoom: map.zoom,
        direction: map.direction,
        light: map.light,
        time: map.time ?? undefined,
      };
    for (const each of this.#parts("map-3d-layer, map-3d-marker")) each.leave();
    map.remove();
    this.#content?.clear();
    this.#map = this.#base = null;
    this.#added.clear();
    this.#ready = this.#drawn = false;
  }

  #scheduleRenew(): void {
    if (this.#renewScheduled) return;
    this.#renewScheduled = true;
    queueMicrotask(() => {
      this.#renewScheduled = false;
      if (!this.#map) return;
      this.#destroy();
      this.#create();
    });
  }

  /** Shows the map or the fallback content, which includes the content of the markers. */
  #updateContent(): void {
    const map = this.#map;
    if (!map) return;
    const wasDrawn = this.#drawn;
    this.#drawn = map.drawer !== null && map.layers.some((layer) => !this.#failed.has(layer));
    if (this.#drawn !== wasDrawn) for (const each of this.#parts("map-3d-marker")) each.enter(this);
    this.#content?.show(this.#drawn, map.language);
  }

  /** Parts that are already defined; the others add themselves. */
  #parts(selector: string): Part<Addable<Map3D>>[] {
    return [...this.querySelectorAll<Part<Addable<Map3D>>>(selector)].filter((element) => "enter" in element);
  }

  // Attributes

  #options(): MapOptions {
    const given = OPTION_ROWS.map(([name, { read }]) => [name, this.#saved[name as keyof SavedState] ?? this.#try(() => read(this))]);
    return Object.fromEntries(
      [["cover", true], ["gestureHandling", "auto"], ...given].filter(([, value]) => value !== undefined),
    ) as MapOptions;
  }

  /** Applies a changed attribute to the map. A removed attribute changes nothing, except for those of the layer. @throws UsageError */
  #apply(name: string): void {
    const map = this.#map as Map3D;
    const option = OPTION_ROWS.find(([key]) => key === (name === "lonlat" ? "center" : name))?.[1];
    if (this.#base && (name === "mode" || name === "opacity")) updateLayer(this, this.#base, name);
    else if (this.getAttribute(name) === null) return;
    else if (name === "time") ifDefined(time(this), (time) => map.setTime(time));
    else ifDefined(option?.read(this), (value) => option?.apply?.(map, value));
  }

  /** Sets the light of the attributes, else that of rendered shadows. @throws UsageError */
  #startLight(): void {
    const [map, rendering] = [this.#map as Map3D, this.#base?.rendering];
    if (this.hasAttribute("time")) this.#apply("time");
    const sun = this.hasAttribute("time") || this.hasAttribute("light") ? undefined : findFirstSun(rendering?.json.layers ?? []);
    if (!sun) return;
    const [east, north, up] = sun.direction;
    if (sun.time !== null && rendering?.json.geographic) map.setTime(new Date(sun.time));
    else map.setLight({ azimuth_deg: (Math.atan2(east, north) * 180) / Math.PI, elevation_deg: (Math.asin(up) * 180) / Math.PI });
  }

  #try<T>(action: () => T): T | undefined {
    try {
      return action();
    } catch (reason) {
      this.report(reason);
      return undefined;
    }
  }

  // Events

  readonly #dispatch: FireEvent = (type, fields) => {
    if (type === "ready") this.#onReady();
    const event = new CustomEvent(`map-${type}`, { detail: fields, bubbles: true, composed: true, cancelable: type === "error" });
    const handled = !this.dispatchEvent(event);
    if ("error" in fields && !handled) console.warn(`map3d: ${fields.error.message}`);
  };

  /** Applies the saved time once the map is ready: the sun's position needs the location of the scene. */
  #onReady(): void {
    this.#ready = true;
    const { light: savedLight, time: savedTime } = this.#saved;
    if (savedTime) this.#try(() => this.#map?.setTime(savedTime));
    else if (!savedLight) this.#try(() => this.#startLight());
    this.#saved = {};
    this.#updateContent();
  }
}

const ifDefined = <T>(value: T | undefined, action: (value: T) => unknown): void => {
  if (value !== undefined) action(value);
};

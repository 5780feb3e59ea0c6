import { checkNumber } from "../core/check";
import type { Light } from "../geo/light";
import type { Corner } from "../core/corner";
import { fillOptions, option, optionOr, type FilledOptionsOf, type OptionsOf } from "../core/options";
import { checkPosition, type AnyPosition } from "../core/position";
import { checkBounds, type Bounds } from "./cameras";
import type { Pick } from "./picker";
import type { Attribute, ObjectInfo } from "../tiles/objects";
import type { Marker } from "../overlay/marker";

/** Makes a check that accepts undefined and null. */
const ifGiven =
  <T>(check: (value: T, name: string) => unknown) =>
  (value: T, name: string): unknown =>
    value && check(value, name);

/** The options of a map. */
export const MAP_OPTIONS = {
  /** Shows buttons and compass: true, at the lower right, or a corner (needs the entry `controls`). Default true. */
  controls: optionOr<boolean | Corner>(true),
  /** Initial centre. Default: the rendering's start. */
  center: option<AnyPosition>(ifGiven(checkPosition)),
  /** Initial zoom. Default: fits everything, or see `cover`. */
  zoom: option<number>(checkNumber),
  /** Lowest zoom. Default: 1.2 levels below the one that shows everything. */
  minZoom: option<number>(checkNumber),
  /** Highest zoom. Default: two levels beyond the deepest one, where a tile pixel is four CSS pixels wide. */
  maxZoom: option<number>(checkNumber),
  /** Box that the map's centre stays in, by two opposite corners. A drag goes a quarter of the screen beyond, with growing resistance, and springs back. Default: the scene's content. */
  maxBounds: option<Bounds>(ifGiven(checkBounds)),
  /** A drag with Shift zooms to a rectangle. Default true. */
  boxZoom: optionOr<boolean>(true),
  /** Who has the wheel and one finger: "greedy" the map; "cooperative" the page, so that the wheel zooms with Ctrl or ⌘ and two fingers move the map; "auto" the page if it scrolls or is in a frame. In full screen, the map. Default "greedy"; `<map-3d>` and the ready-made page use "auto". */
  gestureHandling: optionOr<"greedy" | "cooperative" | "auto">("greedy"),
  /** Without a zoom, enlarges a landscape at first until it fills the map; objects that are high for their width stay whole. Default false; the ready-made page and `<map-3d>` do it. */
  cover: optionOr<boolean>(false),
  /** Id of the initial view, such as "45-22.5". Default: the manifest's first view. */
  direction: option<string>(),
  /** Light at first; the parts that are left out are those of `DEFAULT_LIGHT`. Default: `{ lit: true, azimuth_deg: 215, elevation_deg: 48, ambient: 0.42, diffuse: 0.76, sun_rgb: [1, 1, 1], sky_rgb: [1, 1, 1], shadows: true, occlusion: true }`, from the south-west. */
  light: option<Partial<Light>>(),
  /** CSS background behind the model. Default: the style sheet's, light or dark. */
  background: option<string>(),
  /** Shows the scale bar: true, at the lower left, or a corner. Default: true if there are buttons. */
  scaleBar: option<boolean | Corner>(),
  /** Shows the attribution: true, along the lower edge, or a corner. Default true. */
  attribution: optionOr<boolean | Corner>(true),
  /** Fetches the ids of everything in view, so that "mousemove" reports the object under the pointer. Default false. */
  hover: optionOr<boolean>(false),
  /** Size of the cache of decoded tiles. Tiles in view are always kept. Default: 60 bytes per device pixel of the map, 45 on dense screens, whose tiles have fewer pixels, and less as `maxTileRatio` and `dataSaver` make tiles coarser; at least 24 MB. */
  cacheBytes: option<number>(checkNumber),
  /** Maximum number of concurrent tile requests. Default 12. */
  concurrency: optionOr<number>(12, checkNumber),
  /** Number of decoding threads. Default 2. */
  workers: optionOr<number>(2, checkNumber),
  /** Upper limit of device pixels per CSS pixel. Default 2, as many as tiles have (`maxTileRatio`): on denser screens, the browser enlarges the picture, which spares more than half of the work and memory for pixels. */
  maxPixelRatio: optionOr<number>(2, checkNumber),
  /** Upper limit of tile pixels per CSS pixel: finer tiles cost bytes that few can see. Default 2, so that a tile pixel covers half a CSS pixel to a whole one on screens of any density from 2 on. */
  maxTileRatio: optionOr<number>(2, checkNumber),
  /** Device pixels per CSS pixel. Default: those of the screen, up to `maxPixelRatio`. */
  pixelRatio: option<number>(checkNumber),
  /** Saves data: tiles one level coarser on dense screens, no ids for hovering, no tiles of the neighbouring directions while the map is at rest, shadows and occlusion only on request. "auto": if the user has enabled it in the browser. Default "auto". */
  dataSaver: optionOr<boolean | "auto">("auto"),
  /** @internal Shows tiles of this many levels more. Default 0. */
  finer: optionOr<number>(0),
  /** Language of controls and numbers, BCP 47; English, German and French are supported. Default: that of the page around the map (its `lang`), else the browser's. */
  language: option<string>(),
  /** "webgl" requires WebGL2; "canvas" works without it; "auto" uses WebGL2 on a GPU, else the canvas, which is much faster than WebGL without a GPU. Default "auto". */
  drawer: optionOr<"auto" | "webgl" | "canvas">("auto"),
  /** Keeps the picture readable between frames (for screenshots and tests). Default false. */
  preserveDrawingBuffer: optionOr<boolean>(false),
};

/** Options of a map. */
export interface MapOptions extends OptionsOf<typeof MAP_OPTIONS> {}

/** A map's options with their defaults; `dataSaver` is what "auto" results in. */
export type FilledOptions = FilledOptionsOf<typeof MAP_OPTIONS> & { dataSaver: boolean };

/** Returns a map's options with their defaults. @throws UsageError for unknown and wrong options */
export function fillMapOptions(options: MapOptions): FilledOptions {
  const { dataSaver = "auto" } = options;
  return { ...fillOptions(MAP_OPTIONS, options), dataSaver: dataSaver === "auto" ? savesData() : dataSaver };
}

/** Options of `fitBounds`. */
export interface FitOptions {
  /** Padding on each side. Default 24. */
  padding_px?: number;
  /** Duration of the animation. Default 0: none. */
  duration_ms?: number;
  /** Upper limit of the zoom. Default: the map's. */
  maxZoom?: number;
}

/** Types of a map's events. */
export const EVENTS: readonly (keyof MapEvents)[] = [
  "ready",
  "load",
  "idle",
  "move",
  "moveend",
  "zoom",
  "directionchange",
  "lightchange",
  "preclick",
  "click",
  "mousemove",
  "select",
  "resize",
  "error",
  "contextlost",
  "contextrestored",
  "remove",
];

/** Whether the user wants to save data (Save-Data, or prefers-reduced-data). */
const savesData = (): boolean =>
  (navigator as { connection?: { saveData?: boolean } }).connection?.saveData === true ||
  matchMedia("(prefers-reduced-data: reduce)").matches;

/** A click, and the picked object. */
export interface ClickEvent extends Pick {
  /** CSS pixels from the container's top left corner. */
  readonly point: readonly [number, number];
  readonly name?: string;
  readonly class?: string;
  /** Text, never HTML. */
  readonly attributes?: Readonly<Record<string, Attribute>>;
}

/** A movement of the pointer, and the object under it. */
export interface HoverEvent extends Pick {
  readonly point: readonly [number, number];
}

/** Events of a map, and their fields. */
export interface MapEvents {
  /** The first layer's manifest has loaded: the map has a view. */
  ready: object;
  /** The first complete view has been drawn. Fires once. */
  load: object;
  /** Everything in view is drawn, and nothing moves. */
  idle: object;
  /** The view has changed; fires with each frame that shows it. */
  move: object;
  /** The view has stopped moving. */
  moveend: object;
  /** The zoom has changed; fires with "move". */
  zoom: { zoom: number };
  /** The map has switched to another view of the rendering; its id. */
  directionchange: { direction: string };
  /** The light has been changed by setLight or setTime. */
  lightchange: { light: Readonly<Light> };
  /** Fires immediately on a click, with data in memory. */
  preclick: ClickEvent;
  /** Fires after a click, once exact values and attributes have loaded. */
  click: ClickEvent;
  /** The pointer has moved; with data in memory (see the option `hover`). */
  mousemove: HoverEvent;
  /** A marker has been selected. */
  select: { marker: Marker };
  /** The map's size has changed, CSS pixels. */
  resize: { width: number; height: number };
  /** Something could not be fetched, read or drawn; the map continues. Without a listener, it is logged as a warning. */
  error: { error: Error };
  /** The WebGL context is lost. */
  contextlost: object;
  /** Drawing works again, with WebGL or without it. */
  contextrestored: object;
  /** The map has been removed. */
  remove: object;
}

/** Text of a tooltip, or a function that returns it for an object, or null for none. Strings are shown as text. */
export type TooltipContent = string | ((object: ObjectInfo, id: number) => string | Node | null);

import type { Light } from "../geo/light";
import type { Vec3 } from "../core/vec";
import type { Pick } from "./picker";
import type { Attribute } from "../tiles/objects";
import type { marker } from "../overlay/marker";

/** How a map begins; all can be left out. */
export interface MapOptions {
  /** Where to look first, world coordinates. Default: the rendering's start. */
  center?: Vec3;
  /** Default: everything fits. */
  zoom?: number;
  /** View id such as "45-22.5". Default: the manifest's first view. */
  direction?: string;
  /** Default: from the south-west, 48° high. */
  light?: Partial<Light>;
  /** CSS background behind the model. Default: the style sheet's paper, light or dark. */
  background?: string;
  /** Shows buttons and compass. Default true. */
  controls?: boolean;
  /** Shows the attribution. Default true. */
  attribution?: boolean;
  /** Fetches ids of what is seen, so that "mousemove" tells what lies under the pointer. Default false. */
  hover?: boolean;
  /** Bytes of decoded tiles to keep. What is in view stays, however much that is. Default: 60 for each device pixel of the map, 20 on dense screens, whose tiles have fewer; at least 24 MB. */
  cacheBytes?: number;
  /** Tile requests at once. Default 12. */
  concurrency?: number;
  /** Decoding threads. Default 2. */
  workers?: number;
  /** Device pixels a CSS pixel are at most this. Default 3. */
  maxPixelRatio?: number;
  /** Device pixels a CSS pixel, whatever the screen has. Default: those of the screen, up to `maxPixelRatio`. */
  pixelRatio?: number;
  /** Fewer bytes: coarser tiles on dense screens, no ids for hovering, shadows and occlusion once they are asked for. "auto": where the browser's user saves data. Default "auto". */
  dataSaver?: boolean | "auto";
  /** @internal Tiles of so many levels more than usual. Default 0. */
  finer?: number;
  /** Of controls and numbers, BCP 47; English, German and French are known. Default: that of the page around the map (its `lang`), else the browser's. */
  language?: string;
  /** "webgl" needs WebGL2; "canvas" does without; "auto" takes WebGL2 where a GPU draws it, else the canvas, which is much quicker than WebGL without one. Default "auto". */
  drawer?: "auto" | "webgl" | "canvas";
  /** Keeps the picture readable between frames (screenshots, tests). Default false. */
  preserveDrawingBuffer?: boolean;
}

/** Those without a default of their own. */
type WithoutDefault = "center" | "zoom" | "direction" | "light" | "background" | "language" | "pixelRatio" | "cacheBytes";
export type FilledOptions = MapOptions & Required<Omit<MapOptions, WithoutDefault | "dataSaver">> & { dataSaver: boolean };

export const DEFAULTS: Required<Omit<MapOptions, WithoutDefault>> = {
  controls: true,
  attribution: true,
  hover: false,
  concurrency: 12,
  workers: 2,
  maxPixelRatio: 3,
  drawer: "auto",
  preserveDrawingBuffer: false,
  dataSaver: "auto",
  finer: 0,
};

/** Does the browser's user want fewer bytes (Save-Data, or reduced data)? */
export const savesData = (): boolean =>
  (navigator as { connection?: { saveData?: boolean } }).connection?.saveData === true || matchMedia("(prefers-reduced-data: reduce)").matches;

export interface ClickEvent extends Pick {
  /** CSS pixels from the container's top left corner. */
  readonly point: readonly [number, number];
  readonly name?: string;
  readonly class?: string;
  /** Text, never HTML. */
  readonly attributes?: Readonly<Record<string, Attribute>>;
}

export interface HoverEvent extends Pick {
  readonly point: readonly [number, number];
}

/** What a map fires, and the fields of each event. */
export interface MapEvents {
  /** The first layer's manifest is here: the map has a view. */
  ready: object;
  /** The first complete view has been drawn. Once. */
  load: object;
  /** Everything in view is drawn and nothing moves. */
  idle: object;
  /** The view has changed; fired with each frame that shows it. */
  move: object;
  /** The view rests. */
  moveend: object;
  /** After a change, with "move". */
  zoom: { zoom: number };
  /** Another view of the rendering is shown; its id. */
  directionchange: { direction: string };
  /** By setLight or setTime. */
  lightchange: { light: Readonly<Light> };
  /** At once after a click, from what is in memory. */
  preclick: ClickEvent;
  /** With exact values and attributes, once they are here. */
  click: ClickEvent;
  /** The pointer moves; from what is in memory (see the option `hover`). */
  mousemove: HoverEvent;
  /** A marker was selected. */
  select: { marker: marker };
  /** CSS pixels. */
  resize: { width: number; height: number };
  /** Something could not be fetched, read or drawn; the map goes on. Without a listener it is a warning in the console. */
  error: { error: Error };
  /** The browser has taken WebGL away. */
  contextlost: object;
  /** All is drawn again, by WebGL or without it. */
  contextrestored: object;
  /** The map has ended. */
  remove: object;
}

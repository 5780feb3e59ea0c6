import type { Evented } from "./events";
import type { Vec2, Vec3 } from "./vec";

/** What places on the screen depend on. */
export interface OverlayEvents {
  /** The picture has moved: places on the screen are others now. */
  move: object;
  /** A frame has been drawn: places, or what is known of the surface, may be others now. */
  draw: object;
}

/** What markers, popups and controls see of a map. */
export interface OverlayHost {
  readonly container: HTMLElement;
  /** Holds markers and popups; lies over the picture and lets pointers through. */
  readonly overlayPane: HTMLElement;
  /** BCP 47. */
  readonly language: string;
  /** CSS pixels from the container's top left corner; null while the map has no view yet. */
  project(world: Vec3): Vec2 | null;
  /** Does something that is seen lie before a position? As far as the depths in memory tell. */
  isOccluded(world: Vec3): boolean;
  /** World position of the surface that is seen under a point; null where nothing is, or nothing is known yet. */
  findSurfaceAt(point: Vec2): Vec3 | null;
  readonly frameEvents: Pick<Evented<OverlayEvents>, "on" | "off">;
}

/** Something that can be added to a map. */
export interface Addable<M> {
  /** Layers that it reads: while it is on the map, their tiles are fetched for what is in view. */
  readonly needs?: readonly ("id" | "depth")[];
  /** @internal The map calls it, once. */
  attachTo(map: M): void;
  /** @internal The map calls it, once. */
  detachFrom(map: M): void;
}

/** A map to which things are added. */
export interface LayerHost<M> {
  /** Puts it on the map; nothing when it is there. */
  add(item: Addable<M>): unknown;
  /** Takes it off the map; nothing when it is not there. */
  discard(item: Addable<M>): unknown;
}

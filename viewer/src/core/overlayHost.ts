import type { Evented } from "./events";
import type { LayerHost } from "./mapLayer";
import type { AnyPosition } from "./position";
import type { Vec2, Vec3 } from "./vec";

/** Events after which overlays update their screen positions. */
export interface OverlayEvents {
  /** The view has changed, and with it every screen position. */
  move: object;
  /** A frame has been drawn: screen positions, or the known depths, may have changed. */
  draw: object;
}

/** A map as seen by markers, popups and controls. */
export interface OverlayHost extends LayerHost<OverlayHost> {
  readonly container: HTMLElement;
  /** Holds markers and popups above the picture; lets pointer events through. */
  readonly overlayPane: HTMLElement;
  /** BCP 47. */
  readonly language: string;
  /** CSS pixels from the container's top left corner; null before the map has a view. */
  project(world: Vec3): Vec2 | null;
  /** Whether a visible surface lies in front of a position, judged by the depths in memory. */
  isOccluded(world: Vec3): boolean;
  /** Finds the world coordinates of a position, once the map has a view. */
  findPosition(position: AnyPosition): Promise<Vec3>;
  /** Reports an error by the map's event "error". */
  report(error: Error): void;
  /** World position of the visible surface under a point; null where there is none, or its depth is not loaded. */
  findSurfaceAt(point: Vec2): Vec3 | null;
  readonly frameEvents: Pick<Evented<OverlayEvents>, "on" | "off">;
}

/** Lets the user drag a positioned element: the entry `drag`. */
export type EnableDragging = (
  handle: HTMLElement,
  map: OverlayHost,
  position: () => Vec3 | null,
  onDrag: (type: "dragstart" | "drag" | "dragend", position: Vec3) => void,
) => void;

import type { Vec2, Vec3 } from "../core/vec";
import type { Camera } from "../geo/camera";
import type { Frame } from "../geo/frame";

/** Animates the change from one view to another. */
export interface ViewTransition {
  /** Starts an animation from a camera to the map's new view; `pivot` (local, from the map's origin) stays in place on the screen. */
  start(from: Camera, pivot: Vec3): void;
  /** Rotates the picture clockwise with the pointer. @returns false when the map should switch views itself */
  rotateBy(rad: number): boolean;
  /** The last pointer was released. */
  endGesture(): void;
  /** Computes the camera of the animation at a time, for a map with this camera; null: no animation. */
  step(now_ms: number, camera: Camera): Camera | null;
  /** Draws the animation. */
  draw(scene: TransitionFrame): void;
}

/** Input and functions for drawing a frame of a view transition. */
export interface TransitionFrame {
  readonly gl: WebGL2RenderingContext;
  /** Size of the canvas, device pixels. */
  readonly width: number;
  readonly height: number;
  /** The map's camera. */
  readonly camera: Camera;
  /** Whether tiles have arrived since the last frame. */
  readonly tilesChanged: boolean;
  /** Whether all tiles of the camera's view are in memory. */
  readonly complete: boolean;
  /** Computes the minimum and maximum D of the map's content. */
  getDepthRange(frame: Frame): Vec2;
  /** Draws a camera's view from the tiles in memory, one pixel per CSS pixel, with depth as a fraction of a range of D. */
  drawView(camera: Camera, range: Vec2, into: WebGLFramebuffer): void;
}

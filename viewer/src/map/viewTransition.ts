import type { Vec2, Vec3 } from "../core/vec";
import type { Camera } from "../geo/camera";
import type { Frame } from "../geo/frame";

/** Makes a movement of a change of direction. */
export interface ViewTransition {
  /** The map has looked along `from` and looks along another view now; `pivot` (local, of the map's origin) stays where it is on the screen. */
  start(from: Camera, pivot: Vec3): void;
  /** Two fingers, or a drag, turn the picture clockwise by so much. @returns false when they only count steps */
  rotateBy(rad: number): boolean;
  /** The hand has left. */
  endGesture(): void;
  /** What is to be seen at a time, of a map that looks along `camera`; null: just that. */
  step(now_ms: number, camera: Camera): Camera | null;
  /** Paints the movement. */
  draw(scene: TransitionFrame): void;
}

/** What a turner paints with. */
export interface TransitionFrame {
  readonly gl: WebGL2RenderingContext;
  /** Of the canvas, device pixels. */
  readonly width: number;
  readonly height: number;
  /** What the map looks along. */
  readonly camera: Camera;
  /** Tiles have come since the last frame. */
  readonly tilesChanged: boolean;
  /** All that the camera's view shows is here. */
  readonly complete: boolean;
  /** Least and greatest D of all that is on the map. */
  getDepthRange(frame: Frame): Vec2;
  /** Draws what is in memory of a camera's view, one pixel for a CSS pixel of it, with depth as a share of a range of D. */
  drawView(camera: Camera, range: Vec2, into: WebGLFramebuffer): void;
}

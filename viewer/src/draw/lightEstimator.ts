import type { Addable } from "../core/mapLayer";
import type { Vec2 } from "../core/vec";
import type { FrameContent, LayerPass } from "./drawer";

/** A linked program and the locations of its uniforms; null, which WebGL ignores, for unused ones. */
export interface Program {
  readonly handle: WebGLProgram;
  /** Returns the location of a uniform. */
  at(uniform: string): WebGLUniformLocation | null;
}

/** Draws a pass into the bound framebuffer, with its depth as a fraction of a range of D. */
export type DrawDepths = (frame: FrameContent, pass: LayerPass, range: Vec2) => void;

/** Estimates from depths how much light reaches the visible surfaces. It belongs to one map. */
export interface LightEstimator {
  /** GLSL that declares `vec2 e_read(float depth)`: the fractions of skylight and sunlight at a pixel. Its functions begin with `e_`. */
  readonly shader: string;
  /** Range of D of the depths that the shader receives; null when nothing was estimated. */
  readonly range: Vec2 | null;
  /** Whether it keeps its last estimate, wherever the camera is; for the pieces of a picture. */
  held?: boolean;
  /** Estimates a frame's light, unless all of it was rendered. @param getRange returns the minimum and maximum D of the frame's content */
  update(gl: WebGL2RenderingContext, frame: FrameContent, getRange: () => Vec2, draw: DrawDepths): void;
  /** Whether a pass uses the estimate. */
  appliesTo(frame: FrameContent, pass: LayerPass): boolean;
  /** Sets the uniforms of the shader. */
  bind(gl: WebGL2RenderingContext, program: Program, frame: FrameContent, pass: LayerPass): void;
  /** Makes what adds the same estimator to another map. Without it, exported pictures have no estimated light. */
  copy?(): Addable<never>;
}

import type { Vec2, Vec3 } from "../core/vec";

/** What is seen, by depth alone. */
export interface DepthImage {
  readonly gl: WebGL2RenderingContext;
  /** Of each pixel, as a share of `range`; 1 where nothing is. A depth texture, the lowest row first. */
  readonly depth: WebGLTexture;
  readonly width: number;
  readonly height: number;
  /** Metres a pixel. */
  readonly px_m: number;
  /** Least and greatest D, metres. */
  readonly range: Vec2;
  /** Unit, towards the sun: along right, up and forward of the view; null: nothing of it is asked for. */
  readonly sun: Vec3 | null;
  /** Is the light that is everywhere asked for? */
  readonly occlusion: boolean;
}

/** Finds from depths how much light reaches what is seen. */
export interface LightEstimator {
  /**
   * RGBA8 texture as large as the depths: red is the share of the sky's light, green of the sun's; blue and alpha are the
   * high and the low byte of the depth that they are of. It lasts until the next call.
   */
  estimateLight(seen: DepthImage): WebGLTexture;
}

import type { Vec2, Vec3 } from "../core/vec";

/** The visible surfaces as a depth image. */
export interface DepthImage {
  readonly gl: WebGL2RenderingContext;
  /** Depth of each pixel as a fraction of `range`; 1 where there is no surface. A depth texture, bottom row first. */
  readonly depth: WebGLTexture;
  readonly width: number;
  readonly height: number;
  /** Metres per pixel. */
  readonly px_m: number;
  /** Minimum and maximum D, metres. */
  readonly range: Vec2;
  /** Unit vector towards the sun along the view's right, up and forward axes; null: estimate no shadows. */
  readonly sun: Vec3 | null;
  /** Whether to estimate ambient occlusion. */
  readonly occlusion: boolean;
}

/** Estimates from depths how much light reaches the visible surfaces. */
export interface LightEstimator {
  /**
   * Returns an RGBA8 texture of the size of the depth image: red is the fraction of skylight, green of sunlight; blue and alpha are the
   * high and low byte of the pixel's depth. Valid until the next call.
   */
  estimateLight(depths: DepthImage): WebGLTexture;
}

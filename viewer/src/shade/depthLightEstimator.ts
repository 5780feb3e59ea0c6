import { linkProgram, makeTexture } from "../core/gl";
import type { Vec2, Vec3 } from "../core/vec";
import { SHARES, SMOOTH, VERTEX } from "./shaders";

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

interface ShadeTarget {
  readonly framebuffer: WebGLFramebuffer;
  readonly texture: WebGLTexture;
}

/** GPU resources of a context. */
interface ShadeResources {
  readonly gl: WebGL2RenderingContext;
  readonly shares: WebGLProgram;
  readonly smooth: WebGLProgram;
  readonly targets: readonly [ShadeTarget, ShadeTarget];
  readonly width: number;
  readonly height: number;
}

/** Largest change of D between neighbouring pixels on one surface, in pixels. */
const MAX_STEP_PX = 3;

/** Estimates shadows and ambient occlusion from a depth image, with WebGL. */
export class DepthLightEstimator {
  readonly radius_m: number;
  readonly thickness_m: number;
  #resources: ShadeResources | undefined;

  /** @param radius_m radius of ambient occlusion  @param thickness_m assumed thickness of objects */
  constructor(radius_m: number, thickness_m: number) {
    this.radius_m = radius_m;
    this.thickness_m = thickness_m;
  }

  /**
   * Returns an RGBA8 texture of the size of the depth image: red is the fraction of skylight, green of sunlight; blue and alpha are the
   * high and low byte of the pixel's depth. Valid until the next call.
   */
  estimateLight(image: DepthImage): WebGLTexture {
    const { gl, width, height, px_m } = image;
    const span = image.range[1] - image.range[0];
    const { shares, smooth, targets } = this.#prepare(image);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.BLEND);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.SCISSOR_TEST);
    gl.activeTexture(gl.TEXTURE0);
    gl.useProgram(shares);
    gl.uniform1f(gl.getUniformLocation(shares, "u_px"), px_m);
    gl.uniform1f(gl.getUniformLocation(shares, "u_span"), span);
    gl.uniform3f(gl.getUniformLocation(shares, "u_sun"), ...(image.sun ?? ([0, 0, 0] as const)));
    gl.uniform1f(gl.getUniformLocation(shares, "u_radius"), image.occlusion ? this.radius_m : 0);
    gl.uniform1f(gl.getUniformLocation(shares, "u_thick"), this.thickness_m);
    draw(gl, image.depth, targets[0]);
    gl.useProgram(smooth);
    gl.uniform1f(gl.getUniformLocation(smooth, "u_same"), (MAX_STEP_PX * px_m) / span + 1 / 65535);
    draw(gl, targets[0].texture, targets[1]);
    gl.bindTexture(gl.TEXTURE_2D, null);
    return targets[1].texture;
  }

  /** Frees its GPU resources. */
  free(): void {
    const { gl, shares, smooth, targets } = this.#resources ?? {};
    for (const { framebuffer, texture } of targets ?? []) {
      gl?.deleteFramebuffer(framebuffer);
      gl?.deleteTexture(texture);
    }
    for (const program of [shares, smooth]) gl?.deleteProgram(program ?? null);
    this.#resources = undefined;
  }

  #prepare({ gl, width, height }: DepthImage): ShadeResources {
    const resources = this.#resources;
    if (resources?.gl === gl && resources.width === width && resources.height === height) return resources;
    this.free();
    return (this.#resources = {
      gl,
      width,
      height,
      shares: linkProgram(gl, "shares", VERTEX, SHARES),
      smooth: linkProgram(gl, "smooth", VERTEX, SMOOTH),
      targets: [target(gl, width, height), target(gl, width, height)],
    });
  }
}

function draw(gl: WebGL2RenderingContext, from: WebGLTexture, { framebuffer }: ShadeTarget): void {
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.bindTexture(gl.TEXTURE_2D, from);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}

function target(gl: WebGL2RenderingContext, width: number, height: number): ShadeTarget {
  gl.activeTexture(gl.TEXTURE0);
  const [framebuffer, texture] = [gl.createFramebuffer(), makeTexture(gl, gl.RGBA8, width, height)];
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  return { framebuffer, texture };
}

import { linkProgram, makeTexture } from "../core/gl";
import type { DepthImage, LightEstimator } from "../map3d";
import { SHARES, SMOOTH, VERTEX } from "./shaders";

interface Target {
  readonly framebuffer: WebGLFramebuffer;
  readonly texture: WebGLTexture;
}

/** What a context holds. */
interface Made {
  readonly gl: WebGL2RenderingContext;
  readonly shares: WebGLProgram;
  readonly smooth: WebGLProgram;
  readonly targets: readonly [Target, Target];
  readonly width: number;
  readonly height: number;
}

/** D may change by so many pixels from one pixel to the next on one surface. */
const STEEPEST = 3;

/** Shares of light from depths, with WebGL. */
export class Shading implements LightEstimator {
  readonly radius_m: number;
  readonly thickness_m: number;
  #made: Made | undefined;

  /** @param radius_m what stands nearer keeps the sky's light off  @param thickness_m what is seen counts as solid so far behind its surface */
  constructor(radius_m: number, thickness_m: number) {
    this.radius_m = radius_m;
    this.thickness_m = thickness_m;
  }

  estimateLight(seen: DepthImage): WebGLTexture {
    const { gl, width, height, px_m } = seen;
    const span = seen.range[1] - seen.range[0];
    const { shares, smooth, targets } = this.#prepare(seen);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.BLEND);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.SCISSOR_TEST);
    gl.activeTexture(gl.TEXTURE0);
    gl.useProgram(shares);
    gl.uniform1f(gl.getUniformLocation(shares, "u_px"), px_m);
    gl.uniform1f(gl.getUniformLocation(shares, "u_span"), span);
    gl.uniform3f(gl.getUniformLocation(shares, "u_sun"), ...(seen.sun ?? ([0, 0, 0] as const)));
    gl.uniform1f(gl.getUniformLocation(shares, "u_radius"), seen.occlusion ? this.radius_m : 0);
    gl.uniform1f(gl.getUniformLocation(shares, "u_thick"), this.thickness_m);
    draw(gl, seen.depth, targets[0]);
    gl.useProgram(smooth);
    gl.uniform1f(gl.getUniformLocation(smooth, "u_same"), (STEEPEST * px_m) / span + 1 / 65535);
    draw(gl, targets[0].texture, targets[1]);
    gl.bindTexture(gl.TEXTURE_2D, null);
    return targets[1].texture;
  }

  /** Gives back what it holds of a context. */
  free(): void {
    const { gl, shares, smooth, targets } = this.#made ?? {};
    for (const { framebuffer, texture } of targets ?? []) {
      gl?.deleteFramebuffer(framebuffer);
      gl?.deleteTexture(texture);
    }
    for (const program of [shares, smooth]) gl?.deleteProgram(program ?? null);
    this.#made = undefined;
  }

  #prepare({ gl, width, height }: DepthImage): Made {
    const made = this.#made;
    if (made?.gl === gl && made.width === width && made.height === height && gl.isProgram(made.shares)) return made;
    this.free();
    return (this.#made = { gl, width, height, shares: linkProgram(gl, "shares", VERTEX, SHARES), smooth: linkProgram(gl, "smooth", VERTEX, SMOOTH), targets: [target(gl, width, height), target(gl, width, height)] });
  }
}

function draw(gl: WebGL2RenderingContext, from: WebGLTexture, { framebuffer }: Target): void {
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.bindTexture(gl.TEXTURE_2D, from);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}

function target(gl: WebGL2RenderingContext, width: number, height: number): Target {
  gl.activeTexture(gl.TEXTURE0);
  const [framebuffer, texture] = [gl.createFramebuffer(), makeTexture(gl, gl.RGBA8, width, height)];
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  return { framebuffer, texture };
}

import { linkProgram, makeTexture } from "../core/gl";
import { dot, type Vec2, type Vec3 } from "../core/vec";
import { uvdFromLocal, type Axes } from "../geo/axes";
import { cssPixelM, type Camera } from "../geo/camera";
import { MIX_FRAGMENT, MIX_VERTEX, STEP, WARP_FRAGMENT, WARP_VERTEX } from "./shaders";

/** Colours and depths of what a camera sees, one pixel per CSS pixel. */
export interface RgbdImage {
  /** The camera whose screen is at the centre of the image. */
  readonly source: Camera;
  readonly camera: Camera;
  /** D at depth 0 and 1. */
  readonly range: Vec2;
  readonly target: WarpTarget;
}

interface WarpTarget {
  readonly width: number;
  readonly height: number;
  readonly framebuffer: WebGLFramebuffer;
  readonly color: WebGLTexture;
  readonly depth: WebGLTexture;
}

/** Neighbouring texels belong to different surfaces when D differs by more than this, in texels. */
const MAX_STEP_PX = 6;
/** Two images show the same surface up to this difference of D, in texels. */
const TIE_PX = 4;

/** The view that images are warped to: camera, pivot (local) and range of D. */
export interface WarpView {
  readonly camera: Camera;
  readonly pivot: Vec3;
  readonly range: Vec2;
}

/** Warps images to another view and blends them. Owns its GPU resources. */
export class Warp {
  readonly #gl: WebGL2RenderingContext;
  readonly #warp: WebGLProgram;
  readonly #mix: WebGLProgram;
  readonly #targets: WarpTarget[] = [];
  #warped: readonly [WarpTarget, WarpTarget] | undefined;

  /** @throws DrawError */
  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.#warp = linkProgram(gl, "warp", WARP_VERTEX, WARP_FRAGMENT);
    this.#mix = linkProgram(gl, "mix", MIX_VERTEX, MIX_FRAGMENT);
  }

  get gl(): WebGL2RenderingContext {
    return this.#gl;
  }

  /** Creates a render target. */
  createTarget(width: number, height: number): WarpTarget {
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE0);
    const [color, depth] = [makeTexture(gl, gl.RGBA8, width, height, gl.LINEAR), makeTexture(gl, gl.DEPTH_COMPONENT32F, width, height)];
    const framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, color, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depth, 0);
    const target = { width, height, framebuffer, color, depth };
    this.#targets.push(target);
    return target;
  }

  /** Draws the blend of two images, as seen by another camera. @param fraction weight of the second image  @param canvas size in device pixels  @param size size of the warped images */
  draw(
    images: readonly [RgbdImage, RgbdImage],
    view: WarpView,
    fraction: number,
    canvas: { width: number; height: number },
    size: Vec2,
  ): void {
    const gl = this.#gl;
    const warped = (this.#warped ??= [this.createTarget(...size), this.createTarget(...size)]);
    gl.disable(gl.BLEND);
    gl.disable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
    gl.useProgram(this.#warp);
    images.forEach((image, k) => this.#warpImage(image, view, warped[k as 0 | 1]));
    gl.disable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.useProgram(this.#mix);
    this.#bind(this.#mix, { u_colorA: warped[0].color, u_colorB: warped[1].color, u_depthA: warped[0].depth, u_depthB: warped[1].depth });
    gl.uniform1f(this.#at(this.#mix, "u_share"), fraction);
    gl.uniform1f(
      this.#at(this.#mix, "u_tie"),
      (0.5 * TIE_PX * Math.max(...images.map(({ camera }) => cssPixelM(camera)))) / (view.range[1] - view.range[0]),
    );
    gl.uniform2f(this.#at(this.#mix, "u_pixel"), 1 / canvas.width, 1 / canvas.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.#bind(this.#mix, { u_colorA: null, u_colorB: null, u_depthA: null, u_depthB: null });
  }

  free(): void {
    const gl = this.#gl;
    for (const { framebuffer, color, depth } of this.#targets.splice(0)) {
      gl.deleteFramebuffer(framebuffer);
      gl.deleteTexture(color);
      gl.deleteTexture(depth);
    }
    gl.deleteProgram(this.#warp);
    gl.deleteProgram(this.#mix);
  }

  #warpImage({ camera, range, target }: RgbdImage, view: WarpView, into: WarpTarget): void {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, into.framebuffer);
    gl.viewport(0, 0, into.width, into.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.#bind(this.#warp, { u_color: target.color, u_depth: target.depth });
    const at = (name: string): WebGLUniformLocation | null => this.#at(this.#warp, name);
    const px = cssPixelM(camera);
    const [here, there] = [uvdFromLocal(camera.frame.axes, view.pivot), uvdFromLocal(view.camera.frame.axes, view.pivot)];
    const [w, h] = [view.camera.width * cssPixelM(view.camera), view.camera.height * cssPixelM(view.camera)];
    const [near, far] = view.range;
    const columns = Math.ceil((target.width - 1) / STEP);
    gl.uniform2i(at("u_size"), target.width, target.height);
    gl.uniform1i(at("u_columns"), columns);
    gl.uniformMatrix3fv(at("u_turn"), false, rotationOf(camera.frame.axes, view.camera.frame.axes));
    gl.uniform3f(at("u_grid"), camera.u - here[0] - ((target.width - 1) / 2) * px, camera.v - here[1] - ((target.height - 1) / 2) * px, px);
    gl.uniform2f(at("u_range"), range[0] - here[2], range[1] - range[0]);
    gl.uniform1f(at("u_tear"), (MAX_STEP_PX * STEP * px) / (range[1] - range[0]));
    gl.uniform4f(at("u_place"), 2 / w, 2 / h, (2 * (there[0] - view.camera.u)) / w, (2 * (there[1] - view.camera.v)) / h);
    gl.uniform2f(at("u_deep"), (there[2] - near) / (far - near), 1 / (far - near));
    gl.drawArrays(gl.TRIANGLES, 0, 6 * columns * Math.ceil((target.height - 1) / STEP));
  }

  #bind(program: WebGLProgram, textures: Record<string, WebGLTexture | null>): void {
    const gl = this.#gl;
    Object.entries(textures).forEach(([name, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(this.#at(program, name), unit);
    });
  }

  #at(program: WebGLProgram, name: string): WebGLUniformLocation | null {
    return this.#gl.getUniformLocation(program, name);
  }
}

/** Rotation matrix from one frame's U, V, D to another's, column-major. */
export function rotationOf(here: Axes, there: Axes): number[] {
  return [here.right, here.up, here.forward].flatMap((from) => [there.right, there.up, there.forward].map((to) => dot(from, to)));
}

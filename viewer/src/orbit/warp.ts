import { linkProgram, makeTexture } from "../core/gl";
import { dot, type Vec2, type Vec3 } from "../core/vec";
import { uvdFromLocal, type Axes } from "../geo/axes";
import { cssPixelM, type Camera } from "../geo/camera";
import { MIX_FRAGMENT, MIX_VERTEX, STEP, WARP_FRAGMENT, WARP_VERTEX } from "./shaders";

/** Colours and depths of what a camera sees: a pixel for each CSS pixel of it. */
export interface Shot {
  /** Whose screen is in the middle of it. */
  readonly of: Camera;
  readonly camera: Camera;
  /** Of D, at depth 0 and 1. */
  readonly range: Vec2;
  readonly target: Target;
}

interface Target {
  readonly width: number;
  readonly height: number;
  readonly framebuffer: WebGLFramebuffer;
  readonly color: WebGLTexture;
  readonly depth: WebGLTexture;
}

/** Neighbouring texels whose D differ by more than so many texels do not belong together. */
const STEEPEST = 6;
/** Of one surface, in metres: so many texels. */
const SAME_PX = 4;

/** What is moved where: a camera that is shown, the pivot (local), and least and greatest D along it. */
export interface Goal {
  readonly camera: Camera;
  readonly pivot: Vec3;
  readonly range: Vec2;
}

/** Draws shots as another direction sees them. Makes what it needs of a context, and frees it. */
export class Warp {
  readonly #gl: WebGL2RenderingContext;
  readonly #warp: WebGLProgram;
  readonly #mix: WebGLProgram;
  readonly #made: Target[] = [];
  #moved: readonly [Target, Target] | undefined;

  /** @throws DrawError */
  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.#warp = linkProgram(gl, "warp", WARP_VERTEX, WARP_FRAGMENT);
    this.#mix = linkProgram(gl, "mix", MIX_VERTEX, MIX_FRAGMENT);
  }

  get gl(): WebGL2RenderingContext {
    return this.#gl;
  }

  /** A place for a shot. */
  target(width: number, height: number): Target {
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE0);
    const [color, depth] = [makeTexture(gl, gl.RGBA8, width, height, gl.LINEAR), makeTexture(gl, gl.DEPTH_COMPONENT32F, width, height)];
    const framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, color, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depth, 0);
    const made = { width, height, framebuffer, color, depth };
    this.#made.push(made);
    return made;
  }

  /** Shows shots as the goal's camera sees them on a canvas of so many device pixels. @param share of the second */
  show(shots: readonly [Shot, Shot], goal: Goal, share: number, canvas: { width: number; height: number }, size: Vec2): void {
    const gl = this.#gl;
    const moved = (this.#moved ??= [this.target(...size), this.target(...size)]);
    gl.disable(gl.BLEND);
    gl.disable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
    gl.useProgram(this.#warp);
    shots.forEach((shot, k) => { this.#move(shot, goal, moved[k as 0 | 1]); });
    gl.disable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.useProgram(this.#mix);
    this.#bind(this.#mix, { u_colorA: moved[0].color, u_colorB: moved[1].color, u_depthA: moved[0].depth, u_depthB: moved[1].depth });
    gl.uniform1f(this.#at(this.#mix, "u_share"), share);
    gl.uniform1f(this.#at(this.#mix, "u_tie"), (0.5 * SAME_PX * Math.max(...shots.map(({ camera }) => cssPixelM(camera)))) / (goal.range[1] - goal.range[0]));
    gl.uniform2f(this.#at(this.#mix, "u_pixel"), 1 / canvas.width, 1 / canvas.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.#bind(this.#mix, { u_colorA: null, u_colorB: null, u_depthA: null, u_depthB: null });
  }

  free(): void {
    const gl = this.#gl;
    for (const { framebuffer, color, depth } of this.#made.splice(0)) {
      gl.deleteFramebuffer(framebuffer);
      gl.deleteTexture(color);
      gl.deleteTexture(depth);
    }
    gl.deleteProgram(this.#warp);
    gl.deleteProgram(this.#mix);
  }

  #move({ camera, range, target }: Shot, goal: Goal, into: Target): void {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, into.framebuffer);
    gl.viewport(0, 0, into.width, into.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.#bind(this.#warp, { u_color: target.color, u_depth: target.depth });
    const at = (name: string): WebGLUniformLocation | null => this.#at(this.#warp, name);
    const px = cssPixelM(camera);
    const [here, there] = [uvdFromLocal(camera.frame.axes, goal.pivot), uvdFromLocal(goal.camera.frame.axes, goal.pivot)];
    const [w, h] = [goal.camera.width * cssPixelM(goal.camera), goal.camera.height * cssPixelM(goal.camera)];
    const [near, far] = goal.range;
    const columns = Math.ceil((target.width - 1) / STEP);
    gl.uniform2i(at("u_size"), target.width, target.height);
    gl.uniform1i(at("u_columns"), columns);
    gl.uniformMatrix3fv(at("u_turn"), false, turnOf(camera.frame.axes, goal.camera.frame.axes));
    gl.uniform3f(at("u_grid"), camera.u - here[0] - ((target.width - 1) / 2) * px, camera.v - here[1] - ((target.height - 1) / 2) * px, px);
    gl.uniform2f(at("u_range"), range[0] - here[2], range[1] - range[0]);
    gl.uniform1f(at("u_tear"), (STEEPEST * STEP * px) / (range[1] - range[0]));
    gl.uniform4f(at("u_place"), 2 / w, 2 / h, (2 * (there[0] - goal.camera.u)) / w, (2 * (there[1] - goal.camera.v)) / h);
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

/** Column by column: U, V, D there of the unit vectors here. */
export function turnOf(here: Axes, there: Axes): number[] {
  return [here.right, here.up, here.forward].flatMap((from) => [there.right, there.up, there.forward].map((to) => dot(from, to)));
}

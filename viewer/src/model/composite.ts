import { linkProgram } from "../core/gl";
import { RECT_VERTEX } from "../core/shaders";
import type { ScreenRect } from "./projection";
import { FRAGMENT } from "./shaders";

/** Copies an image with depth to the screen, pixel for pixel. */
export class CompositePass {
  readonly #gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;

  /** @throws DrawError */
  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.#program = linkProgram(gl, "model", RECT_VERTEX, FRAGMENT);
  }

  /** Draws the image. @param rect where it goes on the screen  @param screen size in device pixels */
  draw(
    color: WebGLTexture,
    depth: WebGLTexture,
    { x, y, width, height }: ScreenRect,
    screen: { width: number; height: number },
    soft: boolean,
  ): void {
    const gl = this.#gl;
    const at = (name: string): WebGLUniformLocation | null => gl.getUniformLocation(this.#program, name);
    gl.useProgram(this.#program);
    [color, depth].forEach((texture, unit) => this.#bind(unit, texture));
    gl.uniform1i(at("u_color"), 0);
    gl.uniform1i(at("u_depth"), 1);
    gl.uniform2i(at("u_corner"), x, screen.height - y - height);
    gl.uniform1i(at("u_soft"), Number(soft));
    gl.uniform4f(
      at("u_rect"),
      (2 * x) / screen.width - 1,
      1 - (2 * y) / screen.height,
      (2 * (x + width)) / screen.width - 1,
      1 - (2 * (y + height)) / screen.height,
    );
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    [0, 1].forEach((unit) => this.#bind(unit, null));
  }

  free(): void {
    this.#gl.deleteProgram(this.#program);
  }

  #bind(unit: number, texture: WebGLTexture | null): void {
    this.#gl.activeTexture(this.#gl.TEXTURE0 + unit);
    this.#gl.bindTexture(this.#gl.TEXTURE_2D, texture);
  }
}

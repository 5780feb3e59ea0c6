import { linkProgram } from "../core/gl";
import type { Part } from "./place";

const VERTEX = `#version 300 es
uniform vec4 u_rect; // left, top, right, bottom in clip space
void main() {
  bool right = (gl_VertexID & 1) == 1, bottom = gl_VertexID > 1;
  gl_Position = vec4(right ? u_rect.z : u_rect.x, bottom ? u_rect.w : u_rect.y, 0.0, 1.0);
}`;

/** As the images are drawn: light becomes sRGB at last, and pixels that are covered in part have the depth of the nearest around them. */
const FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D u_color; // linear, premultiplied
uniform sampler2D u_depth;
uniform ivec2 u_corner;   // left bottom
uniform bool u_soft;
out vec4 o_color;

vec3 srgb(vec3 c) { return mix(c * 12.92, 1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }
float depthAt(ivec2 at) { return texelFetch(u_depth, clamp(at, ivec2(0), textureSize(u_depth, 0) - 1), 0).r; }

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy) - u_corner;
  vec4 c = texelFetch(u_color, at, 0);
  if (c.a == 0.0 || (c.a > 0.998) != !u_soft) discard;
  float d = depthAt(at);
  if (d == 1.0) for (int k = 0; k < 9; k++) d = min(d, depthAt(at + ivec2(k % 3 - 1, k / 3 - 1)));
  gl_FragDepth = d;
  o_color = vec4(srgb(clamp(c.rgb / c.a, 0.0, 1.0)) * c.a, c.a);
}`;

/** Puts a picture with depth onto the screen, a pixel for a pixel. */
export class Composite {
  readonly #gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;

  /** @throws DrawError */
  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.#program = linkProgram(gl, "model", VERTEX, FRAGMENT);
  }

  /** @param screen its width and height, device pixels */
  paint(color: WebGLTexture, depth: WebGLTexture, { x, y, width, height }: Part, screen: { width: number; height: number }, soft: boolean): void {
    const gl = this.#gl;
    const at = (name: string): WebGLUniformLocation | null => gl.getUniformLocation(this.#program, name);
    gl.useProgram(this.#program);
    [color, depth].forEach((texture, unit) => { this.#bind(unit, texture); });
    gl.uniform1i(at("u_color"), 0);
    gl.uniform1i(at("u_depth"), 1);
    gl.uniform2i(at("u_corner"), x, screen.height - y - height);
    gl.uniform1i(at("u_soft"), Number(soft));
    gl.uniform4f(at("u_rect"), (2 * x) / screen.width - 1, 1 - (2 * y) / screen.height, (2 * (x + width)) / screen.width - 1, 1 - (2 * (y + height)) / screen.height);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    [0, 1].forEach((unit) => { this.#bind(unit, null); });
  }

  free(): void {
    this.#gl.deleteProgram(this.#program);
  }

  #bind(unit: number, texture: WebGLTexture | null): void {
    this.#gl.activeTexture(this.#gl.TEXTURE0 + unit);
    this.#gl.bindTexture(this.#gl.TEXTURE_2D, texture);
  }
}

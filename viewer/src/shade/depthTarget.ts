import { makeTexture } from "../core/gl";

/** A framebuffer with a depth texture only. */
export class DepthTarget {
  readonly framebuffer: WebGLFramebuffer;
  readonly texture: WebGLTexture;
  readonly #gl: WebGL2RenderingContext;

  constructor(
    gl: WebGL2RenderingContext,
    readonly width: number,
    readonly height: number,
  ) {
    this.#gl = gl;
    this.framebuffer = gl.createFramebuffer();
    this.texture = makeTexture(gl, gl.DEPTH_COMPONENT32F, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.texture, 0);
    gl.drawBuffers([gl.NONE]);
    gl.readBuffer(gl.NONE);
  }

  free(): void {
    this.#gl.deleteFramebuffer(this.framebuffer);
    this.#gl.deleteTexture(this.texture);
  }
}

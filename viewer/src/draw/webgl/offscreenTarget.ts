/** What frames are drawn in that need depth: most do not, and then the canvas has no buffer for it. Pixels are copied to the canvas as they are. */
export class OffscreenTarget {
  readonly #gl: WebGL2RenderingContext;
  readonly #framebuffer: WebGLFramebuffer;
  readonly #buffers: readonly WebGLRenderbuffer[];

  constructor(gl: WebGL2RenderingContext, readonly width: number, readonly height: number) {
    this.#gl = gl;
    this.#framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer);
    this.#buffers = ([[gl.RGBA8, gl.COLOR_ATTACHMENT0], [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]] as const).map(([format, attachment]) => {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, attachment, gl.RENDERBUFFER, buffer);
      return buffer;
    });
  }

  get framebuffer(): WebGLFramebuffer {
    return this.#framebuffer;
  }

  /** Puts the picture on the canvas, which is bound then. */
  copyToCanvas(): void {
    const { width, height } = this;
    const gl = this.#gl;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#framebuffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  free(): void {
    this.#gl.deleteFramebuffer(this.#framebuffer);
    for (const buffer of this.#buffers) this.#gl.deleteRenderbuffer(buffer);
  }
}

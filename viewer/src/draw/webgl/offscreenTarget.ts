/** A framebuffer for frames that need a depth buffer, which the canvas does not have. */
export class OffscreenTarget {
  readonly #gl: WebGL2RenderingContext;
  readonly #framebuffer: WebGLFramebuffer;
  readonly #buffers: readonly WebGLRenderbuffer[];

  constructor(
    gl: WebGL2RenderingContext,
    readonly width: number,
    readonly height: number,
  ) {
    this.#gl = gl;
    this.#framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer);
    this.#buffers = (
      [
        [gl.RGBA8, gl.COLOR_ATTACHMENT0],
        [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT],
      ] as const
    ).map(([format, attachment]) => {
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

  /** Copies the picture to the canvas, which is bound afterwards. */
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

/** Draws when something has changed, and never else. */
export class FrameLoop {
  #handle = 0;
  readonly #draw: (now_ms: number) => void;

  constructor(draw: (now_ms: number) => void) {
    this.#draw = draw;
  }

  request(): void {
    this.#handle ||= requestAnimationFrame((now) => {
      this.#handle = 0;
      this.#draw(now);
    });
  }

  get waiting(): boolean {
    return this.#handle !== 0;
  }

  stop(): void {
    cancelAnimationFrame(this.#handle);
    this.#handle = -1; // a removed map asks for no more frames
  }
}

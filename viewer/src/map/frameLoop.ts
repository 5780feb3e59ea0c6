/** Maximum wait of an urgent frame for the browser. */
const SOON_MS = 20;

/** Draws a frame after each request; never without one. */
export class FrameLoop {
  #handle = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;
  readonly #draw: (now_ms: number) => void;

  constructor(draw: (now_ms: number) => void) {
    this.#draw = draw;
  }

  /** Requests a frame. @param soon does not wait for a browser that is slow to draw, as while a page loads */
  request(soon = false): void {
    this.#handle ||= requestAnimationFrame((now) => this.#run(now));
    if (soon && this.#handle > 0) this.#timer ??= setTimeout(() => this.#run(performance.now()), SOON_MS);
  }

  get pending(): boolean {
    return this.#handle !== 0;
  }

  stop(): void {
    this.#cancel();
    this.#handle = -1; // ignores later requests
  }

  #run(now_ms: number): void {
    this.#cancel();
    this.#draw(now_ms);
  }

  #cancel(): void {
    cancelAnimationFrame(this.#handle);
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.#handle = 0;
  }
}

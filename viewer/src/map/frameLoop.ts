/** How long a frame that is wanted soon waits for the browser. */
const SOON_MS = 20;

/** Draws when something has changed, and never else. */
export class FrameLoop {
  #handle = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;
  readonly #draw: (now_ms: number) => void;

  constructor(draw: (now_ms: number) => void) {
    this.#draw = draw;
  }

  /** @param soon does not wait for a browser that is slow to show pictures, as it is while a page opens */
  request(soon = false): void {
    this.#handle ||= requestAnimationFrame((now) => { this.#run(now); });
    if (soon && this.#handle > 0) this.#timer ??= setTimeout(() => { this.#run(performance.now()); }, SOON_MS);
  }

  get pending(): boolean {
    return this.#handle !== 0;
  }

  stop(): void {
    this.#cancel();
    this.#handle = -1; // a removed map asks for no more frames
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

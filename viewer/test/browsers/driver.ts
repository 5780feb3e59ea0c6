import { decodePng } from "../../src/core/png";

/** An input source and its actions, as in WebDriver and WebDriver BiDi. */
export type Input =
  | {
      readonly type: "pointer";
      readonly id: string;
      readonly parameters: { readonly pointerType: "mouse" };
      readonly actions: readonly object[];
    }
  | { readonly type: "wheel" | "key"; readonly id: string; readonly actions: readonly object[] };

type Point = readonly [x: number, y: number];

/** A screenshot: RGB bytes from the page's top left corner. */
export interface Screenshot {
  readonly width: number;
  readonly height: number;
  readonly rgb: Uint8Array;
  readonly png: Buffer;
}

/** A browser with one page. */
export abstract class Driver {
  abstract open(url: string): Promise<void>;
  abstract perform(inputs: readonly Input[]): Promise<void>;
  /** Evaluates an expression in the page to JSON; awaits promises. */
  abstract run(expression: string): Promise<unknown>;
  abstract close(): Promise<void>;
  protected abstract capture(): Promise<Buffer>;

  async evaluate<A, R>(act: (argument: A) => R, argument: A): Promise<Awaited<R>> {
    return (await this.run(`(${act.toString()})(${JSON.stringify(argument)})`)) as Awaited<R>;
  }

  /** Runs code in the page and waits until the map rests again. */
  async settled<A>(act: (argument: A) => unknown, argument: A): Promise<void> {
    await this.run(`new Promise((done) => { map.once("idle", () => { done(null); }); (${act.toString()})(${JSON.stringify(argument)}); })`);
  }

  /** Waits until an expression is true. @throws Error after 20 seconds */
  async until<A>(test: (argument: A) => boolean, argument: A): Promise<void> {
    const end = Date.now() + 20_000;
    while (Date.now() < end) {
      if (await this.evaluate(test, argument)) return;
      await pause(50);
    }
    throw new Error(`still false after 20 seconds: ${test.toString()}`);
  }

  async shot(): Promise<Screenshot> {
    const png = await this.capture();
    const { width, height, channels, data } = await decodePng(new Uint8Array(png));
    const rgb = new Uint8Array(3 * width * height);
    for (let p = 0; p < width * height; p++) for (let k = 0; k < 3; k++) rgb[3 * p + k] = data[channels * p + k] ?? 0;
    return { width, height, rgb, png };
  }

  async click(at: Point): Promise<void> {
    await this.#mouse([moveTo(at), DOWN, UP]);
  }

  /** Rests before it releases the button, to avoid inertia. */
  async drag([x, y]: Point, by: Point): Promise<void> {
    const steps = [0.25, 0.5, 0.75, 1].map((part) => moveTo([x + part * by[0], y + part * by[1]], 30));
    await this.#mouse([moveTo([x, y]), DOWN, ...steps, { type: "pause", duration: 200 }, UP]);
  }

  async wheel([x, y]: Point, deltaY: number): Promise<void> {
    await this.perform([
      {
        type: "wheel",
        id: "wheel",
        actions: [{ type: "scroll", x: Math.round(x), y: Math.round(y), deltaX: 0, deltaY, duration: 0, origin: "viewport" }],
      },
    ]);
  }

  async key(value: string): Promise<void> {
    await this.perform([
      {
        type: "key",
        id: "keys",
        actions: [
          { type: "keyDown", value },
          { type: "keyUp", value },
        ],
      },
    ]);
  }

  async #mouse(actions: readonly object[]): Promise<void> {
    await this.perform([{ type: "pointer", id: "mouse", parameters: { pointerType: "mouse" }, actions }]);
  }
}

const DOWN = { type: "pointerDown", button: 0 };
const UP = { type: "pointerUp", button: 0 };
const moveTo = ([x, y]: Point, duration = 0): object => ({
  type: "pointerMove",
  x: Math.round(x),
  y: Math.round(y),
  duration,
  origin: "viewport",
});
const pause = (ms: number): Promise<void> =>
  new Promise((done) => {
    setTimeout(done, ms);
  });

/** Numbers of what a page's maps have asked WebGL to do. */
export interface Recorded {
  draws: number;
  uploads: number;
  frames: number;
}

/**
 * Gives canvases a WebGL2 context that draws nothing and stores nothing, but counts calls in `recorded`. The shipped WebGL drawer runs on it as on a GPU; software
 * WebGL would take half the time of a test that looks at no pixel. Runs in the page, before its scripts.
 */
export function recordDrawing(): void {
  const recorded: Recorded = { draws: 0, uploads: 0, frames: 0 };
  Object.assign(globalThis, { recorded });
  const constants = WebGL2RenderingContext as unknown as Record<string, number>;
  const counted: Record<string, keyof Recorded> = { drawArrays: "draws", texSubImage2D: "uploads", texImage2D: "uploads", clear: "frames" };
  const answers: Record<string, () => unknown> = {
    getParameter: () => "a GPU",
    getProgramParameter: () => true,
    getUniformLocation: () => ({}),
    isContextLost: () => false,
    getExtension: () => null,
    checkFramebufferStatus: () => constants["FRAMEBUFFER_COMPLETE"],
    getError: () => 0,
  };
  const answerOf = (name: string): unknown => {
    if (/^[A-Z]/.test(name)) return constants[name];
    const count = counted[name];
    if (count !== undefined)
      return () => {
        recorded[count]++;
      };
    return answers[name] ?? (name.startsWith("create") ? () => ({}) : () => undefined);
  };
  const make = (canvas: HTMLCanvasElement): WebGL2RenderingContext => {
    const members = new Map<string, unknown>([["canvas", canvas]]);
    return new Proxy(
      {},
      {
        get: (_, name) => {
          if (!members.has(String(name))) members.set(String(name), answerOf(String(name)));
          return members.get(String(name));
        },
      },
    ) as WebGL2RenderingContext;
  };
  const contexts = new WeakMap<HTMLCanvasElement, WebGL2RenderingContext>();
  const own = Object.getOwnPropertyDescriptor(HTMLCanvasElement.prototype, "getContext")?.value as (
    this: HTMLCanvasElement,
    kind: string,
    options?: object,
  ) => RenderingContext | null;
  HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, options?: object): RenderingContext | null {
    const known = contexts.get(this);
    if (kind !== "webgl2") return known ? null : own.call(this, kind, options);
    return known ?? contexts.set(this, make(this)).get(this) ?? null;
  } as typeof HTMLCanvasElement.prototype.getContext;
}

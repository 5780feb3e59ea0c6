import type { ChildProcess } from "node:child_process";
import { existsSync, readdirSync } from "node:fs";
import { createServer, type AddressInfo } from "node:net";
import { spawn } from "node:child_process";
import { stop, type Display } from "./display";
import { Driver, type Input } from "./driver";

export const WEBKIT_DRIVER = process.env["WEBKIT_DRIVER"] ?? "/usr/bin/WebKitWebDriver";

/** The minimal browser of WebKitGTK; in Debian next to its library. */
export function miniBrowser(): string | undefined {
  const folders = [
    "/usr/lib",
    ...(existsSync("/usr/lib")
      ? readdirSync("/usr/lib")
          .filter((name) => name.endsWith("-linux-gnu"))
          .map((name) => `/usr/lib/${name}`)
      : []),
  ];
  const places = folders.flatMap((folder) =>
    ["webkitgtk-6.0", "webkit2gtk-4.1", "webkit2gtk-4.0"].map((name) => `${folder}/${name}/MiniBrowser`),
  );
  return places.find((place) => existsSync(place));
}

/** WebKitGTK over WebDriver. */
export class WebKit extends Driver {
  readonly complaints: readonly string[] = [];

  private constructor(
    private readonly child: ChildProcess,
    private readonly session: string,
  ) {
    super();
  }

  static async start(display: Display): Promise<WebKit> {
    const port = await freePort();
    // The sandbox does not work as root; only local pages are opened.
    const env = { ...process.env, DISPLAY: display.name, LIBGL_ALWAYS_SOFTWARE: "1", WEBKIT_DISABLE_SANDBOX_THIS_IS_DANGEROUS: "1" };
    const child = spawn(WEBKIT_DRIVER, [`--port=${String(port)}`], { stdio: "ignore", env });
    const browser = { binary: miniBrowser(), args: ["--automation"] };
    const address = `http://127.0.0.1:${String(port)}/session`;
    const { sessionId } = (await patiently(() =>
      ask("POST", address, { capabilities: { alwaysMatch: { "webkitgtk:browserOptions": browser } } }),
    )) as { sessionId: string };
    const webkit = new WebKit(child, `${address}/${sessionId}`);
    await webkit.#post("/timeouts", { script: 60_000, pageLoad: 60_000 });
    await webkit.#post("/window/rect", { width: 800, height: 600 });
    return webkit;
  }

  async open(url: string): Promise<void> {
    await this.#post("/url", { url });
  }

  async perform(actions: readonly Input[]): Promise<void> {
    await this.#post("/actions", { actions: actions.map(unlikeLast) });
  }

  async run(expression: string): Promise<unknown> {
    const script = `const done = arguments[arguments.length - 1]; (async () => ({ value: (await ${expression}) ?? null }))().then((it) => done(JSON.stringify(it)), (reason) => done(JSON.stringify({ error: String(reason) })));`;
    const answer = JSON.parse((await this.#post("/execute/async", { script, args: [] })) as string) as { value?: unknown; error?: string };
    if (answer.error !== undefined) throw new Error(answer.error);
    return answer.value;
  }

  async close(): Promise<void> {
    await ask("DELETE", this.session).catch(() => undefined);
    await stop(this.child);
  }

  protected async capture(): Promise<Buffer> {
    return Buffer.from((await ask("GET", `${this.session}/screenshot`)) as string, "base64");
  }

  #post(path: string, body: object): Promise<unknown> {
    return ask("POST", this.session + path, body);
  }
}

/** Repeating a wheel step has no effect, so the wheel pauses in between. */
function unlikeLast(input: Input): Input {
  return input.type === "wheel"
    ? { ...input, actions: input.actions.flatMap((action) => [{ ...action, deltaX: 0, deltaY: 0 }, action]) }
    : input;
}

/** @throws Error with the driver's message */
async function ask(method: string, address: string, body?: object): Promise<unknown> {
  const response = await fetch(address, {
    method,
    ...(body && { body: JSON.stringify(body), headers: { "Content-Type": "application/json" } }),
  });
  const { value } = (await response.json()) as { value: { error?: string; message?: string } | null };
  if (!response.ok) throw new Error(`${method} ${address}: ${value?.error ?? ""} ${value?.message ?? ""}`);
  return value;
}

/** Waits until the driver listens. */
async function patiently<T>(act: () => Promise<T>): Promise<T> {
  for (let left = 100; ; left--) {
    try {
      return await act();
    } catch (reason) {
      if (left === 0 || !(reason instanceof TypeError)) throw reason;
      await new Promise((done) => {
        setTimeout(done, 100);
      });
    }
  }
}

function freePort(): Promise<number> {
  return new Promise((done) => {
    const server = createServer().listen(0, "127.0.0.1", () => {
      const { port } = server.address() as AddressInfo;
      server.close(() => {
        done(port);
      });
    });
  });
}

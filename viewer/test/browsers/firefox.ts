import type { ChildProcess } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { WebSocket } from "ws";
import { startUntil, stop, type Display } from "./display";
import { Driver, type Input } from "./driver";

export const FIREFOX = process.env["FIREFOX"] ?? "/usr/bin/firefox-esr";

/** Preferences: quiet, and no network requests. */
const PREFERENCES = {
  "app.update.enabled": false,
  "browser.aboutwelcome.enabled": false,
  "browser.safebrowsing.malware.enabled": false,
  "browser.safebrowsing.phishing.enabled": false,
  "browser.shell.checkDefaultBrowser": false,
  "browser.startup.homepage_override.mstone": "ignore",
  "datareporting.policy.dataSubmissionEnabled": false,
  "extensions.update.enabled": false,
  "network.captive-portal-service.enabled": false,
  "network.connectivity-service.enabled": false,
  "services.settings.server": "data:,none",
  "toolkit.telemetry.enabled": false,
  "webgl.force-enabled": true,
  "remote.prefs.recommended": true,
};

interface Message {
  readonly id?: number;
  readonly method?: string;
  readonly params?: { readonly level?: string; readonly text?: string };
  readonly result?: Record<string, unknown>;
  readonly error?: string;
  readonly message?: string;
}

/** Firefox over WebDriver BiDi. */
export class Firefox extends Driver {
  /** Errors in its console. */
  readonly complaints: string[] = [];
  readonly #waiting = new Map<number, (message: Message) => void>();
  #context = "";
  #count = 0;

  private constructor(
    private readonly child: ChildProcess,
    private readonly socket: WebSocket,
    private readonly profile: string,
  ) {
    super();
    socket.on("message", (bytes: Buffer) => {
      this.#hear(JSON.parse(bytes.toString()) as Message);
    });
  }

  static async start(display: Display, preferences: Record<string, boolean> = {}): Promise<Firefox> {
    const profile = mkdtempSync(join(tmpdir(), "map3d-firefox-"));
    const lines = Object.entries({ ...PREFERENCES, ...preferences }).map(
      ([name, value]) => `user_pref(${JSON.stringify(name)}, ${JSON.stringify(value)});`,
    );
    writeFileSync(join(profile, "user.js"), lines.join("\n"));
    const env = { DISPLAY: display.name, HOME: profile, LIBGL_ALWAYS_SOFTWARE: "1", MOZ_CRASHREPORTER_DISABLE: "1" };
    const { child, found } = await startUntil(
      FIREFOX,
      ["--profile", profile, "--no-remote", "--remote-debugging-port=0", "about:blank"],
      env,
      2,
      /WebDriver BiDi listening on (ws:\S+)/,
    );
    const socket = new WebSocket(`${found}/session`);
    await new Promise((done, fail) => socket.once("open", done).once("error", fail));
    const firefox = new Firefox(child, socket, profile);
    await firefox.#begin();
    return firefox;
  }

  async open(url: string): Promise<void> {
    this.complaints.length = 0;
    await this.#send("browsingContext.navigate", { context: this.#context, url, wait: "complete" });
  }

  async perform(actions: readonly Input[]): Promise<void> {
    await this.#send("input.performActions", { context: this.#context, actions });
  }

  async run(expression: string): Promise<unknown> {
    const { type, result, exceptionDetails } = (await this.#send("script.evaluate", {
      expression: `(async () => JSON.stringify((await ${expression}) ?? null))()`,
      target: { context: this.#context },
      awaitPromise: true,
    })) as { type: string; result?: { value: string }; exceptionDetails?: { text: string } };
    if (type !== "success" || !result) throw new Error(exceptionDetails?.text ?? type);
    return JSON.parse(result.value) as unknown;
  }

  async close(): Promise<void> {
    this.socket.terminate();
    await stop(this.child);
    rmSync(this.profile, { recursive: true, force: true, maxRetries: 5, retryDelay: 200 });
  }

  protected async capture(): Promise<Buffer> {
    const { data } = await this.#send("browsingContext.captureScreenshot", { context: this.#context });
    return Buffer.from(data as string, "base64");
  }

  async #begin(): Promise<void> {
    await this.#send("session.new", { capabilities: {} });
    await this.#send("session.subscribe", { events: ["log.entryAdded"] });
    const { contexts } = await this.#send("browsingContext.getTree", {});
    this.#context = (contexts as { context: string }[])[0]?.context ?? "";
  }

  #send(method: string, params: object): Promise<Record<string, unknown>> {
    const id = ++this.#count;
    return new Promise((done, fail) => {
      this.#waiting.set(id, ({ result, error, message }) => {
        if (result) done(result);
        else fail(new Error(`${method}: ${String(error)} ${String(message)}`));
      });
      this.socket.send(JSON.stringify({ id, method, params }));
    });
  }

  #hear(message: Message): void {
    if (message.id !== undefined) this.#waiting.get(message.id)?.(message);
    else if (message.method === "log.entryAdded" && /error|warn/.test(message.params?.level ?? ""))
      this.complaints.push(message.params?.text ?? "");
  }
}

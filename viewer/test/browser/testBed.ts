import { afterAll, beforeAll } from "vitest";
import type { Browser, BrowserContextOptions } from "playwright-core";
import type { Fixture } from "../fixture/rendering";
import { TestServer } from "../fixture/server";
import { openBrowser, openPage } from "./browser";
import { BARE, begin } from "./page";

type Renderings = Readonly<Record<string, Fixture>>;
type Opened = ReturnType<typeof openPage>;

/** Serves renderings and the bare page while a file's tests run. */
export function serve(renderings: Renderings): TestServer {
  const server = new TestServer();
  for (const [name, rendering] of Object.entries(renderings)) server.renderings.set(name, rendering);
  server.pages.set("/bare", BARE);
  server.pages.set("/bare.css", "html,body{margin:0;height:100%}#mapcanvas{width:100%;height:100vh}");
  beforeAll(async () => { await server.listen(); });
  afterAll(() => server.close());
  return server;
}

/** A server and a browser while a file's tests run. */
export class TestBed {
  readonly server: TestServer;
  #browser: Browser | undefined;

  /** @param env environment variables of the browser */
  constructor(renderings: Renderings, env: Record<string, string> = {}) {
    this.server = serve(renderings);
    beforeAll(async () => { this.#browser = await openBrowser(env); });
    afterAll(() => this.#browser?.close());
  }

  url(rendering: string): string {
    return `${this.server.origin}/tiles/${rendering}`;
  }

  /** @param opening plays the opening of the ready-made page */
  openPage(context: BrowserContextOptions = {}, opening = false): Opened {
    return openPage(this.#browser as Browser, context, opening);
  }

  /** Opens the bare page, without a map. */
  async bare(context: BrowserContextOptions = {}): Opened {
    const opened = await this.openPage(context);
    await opened.page.goto(`${this.server.origin}/bare`);
    return opened;
  }

  /** Opens a page with a map and waits until it rests. Its rendering is a name here, or addresses. */
  async start(rendering: string | string[], options: object = {}, layer: object = {}, context: BrowserContextOptions = {}): Opened {
    const opened = await this.bare(context);
    await opened.page.evaluate(begin, [typeof rendering === "string" ? this.url(rendering) : rendering, options, layer] as const);
    return opened;
  }
}

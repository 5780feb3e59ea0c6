import { afterAll, afterEach, beforeAll } from "vitest";
import type { BrowserContextOptions } from "playwright-core";
import type { Fixture } from "../fixture/rendering";
import { TestServer } from "../fixture/server";
import { closePages, openPage, resting, type PageOptions } from "./browser";
import { BARE, begin } from "./page";

type Renderings = Readonly<Record<string, Fixture>>;
type Opened = ReturnType<typeof openPage>;

/** Serves renderings and the bare page while a file's tests run. */
export function serve(renderings: Renderings): TestServer {
  const server = new TestServer();
  for (const [name, rendering] of Object.entries(renderings)) server.renderings.set(name, rendering);
  server.pages.set("/bare", BARE);
  server.pages.set("/bare.css", "html,body{margin:0;height:100%}#mapcanvas{width:100%;height:100vh}");
  beforeAll(async () => {
    await server.listen();
  });
  afterAll(() => server.close());
  return server;
}

/** A server while a file's tests run, and pages while a test runs. */
export class TestBed {
  readonly server: TestServer;
  readonly #options: PageOptions;

  /** @param served renderings to serve, or the server of another bed  @param options of all its pages */
  constructor(served: Renderings | TestServer, options: PageOptions = {}) {
    this.server = served instanceof TestServer ? served : serve(served);
    this.#options = options;
    afterEach(closePages);
  }

  url(rendering: string): string {
    return `${this.server.origin}/tiles/${rendering}`;
  }

  openPage(context: BrowserContextOptions = {}, options: PageOptions = {}): Opened {
    return openPage(context, { ...this.#options, ...options });
  }

  /** Opens the ready-made page and waits until it rests. @param query follows `?rendering=`: the address of a rendering, further parameters, the fragment */
  async openReadyMade(query = this.url("town"), context: BrowserContextOptions = {}): Opened {
    const opened = await this.openPage(context, { maps: true });
    await opened.page.goto(`${this.server.origin}/?rendering=${query}`);
    await resting(opened.page);
    return opened;
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

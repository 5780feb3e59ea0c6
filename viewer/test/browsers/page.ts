import type { TestServer } from "../fixture/server";
import type { Global } from "../browser/page";

/** A page with a canvas of fixed size, since browsers' windows differ; it collects errors. */
export function watchedPage(server: TestServer): void {
  const head =
    '<meta charset="utf-8"><title>test</title><link rel="icon" href="data:,"><link rel="stylesheet" href="/watched.css"><script src="/watch.js"></script>';
  server.pages.set(
    "/watched",
    `<!doctype html><html lang="en"><head>${head}</head><body><canvas id="mapcanvas"></canvas><script src="/map3d.js"></script></body></html>`,
  );
  server.pages.set("/watched.css", `html,body{margin:0;background:#fff}#mapcanvas{width:${String(WIDTH)}px;height:${String(HEIGHT)}px}`);
  server.pages.set("/watch.js", `(${watch.toString()})()`);
}

export const [WIDTH, HEIGHT] = [480, 360];

export type Watched = Global & { problems: string[] };

function watch(): void {
  const problems: string[] = [];
  const tell = (what: unknown): void => {
    problems.push(String(what));
  };
  (globalThis as unknown as Watched).problems = problems;
  addEventListener("error", ({ message }) => {
    tell(message);
  });
  addEventListener("unhandledrejection", ({ reason }) => {
    tell(reason);
  });
  addEventListener("securitypolicyviolation", ({ blockedURI, violatedDirective }) => {
    tell(`${violatedDirective} forbids ${blockedURI}`);
  });
  console.error = tell;
  console.warn = tell;
}

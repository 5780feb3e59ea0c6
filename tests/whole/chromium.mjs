// Chromium with software WebGL2 and one page in it. Arguments: playwright-core's folder, a JSON document of what is asked.
// A script calls `look` with what it wants to do in the page; what that returns is printed as JSON, with `problems`: what the page complained of.
const [folder, given] = process.argv.slice(2);

const ARGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"];

/** Chromium by playwright-core in a folder; `hosts`: names → addresses with ports. */
export async function launch(library, hosts = {}) {
  const { chromium } = await import(`${library}/index.mjs`);
  const rules = Object.entries(hosts).map(([name, address]) => `MAP ${name} ${address}`);
  const args = rules.length > 0 ? [...ARGS, `--host-resolver-rules=${rules.join(",")}`] : ARGS;
  return chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args });
}

/** In a page: without a GPU, too, maps draw with WebGL, as they do for most readers. */
export function anyWebGL() {
  const own = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return own.call(this, kind, options && { ...options, failIfMajorPerformanceCaveat: false });
  };
  const tell = WebGL2RenderingContext.prototype.getParameter;
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    return name === 0x9246 ? "a GPU" : tell.call(this, name); // UNMASKED_RENDERER_WEBGL
  };
}

/** `act(page, asked)`; `asked.hosts`: names → addresses with ports; `asked.size`: of the window. */
export async function look(act) {
  const asked = JSON.parse(given);
  const browser = await launch(folder, asked.hosts);
  try {
    const [width, height] = asked.size ?? [1000, 700];
    const context = await browser.newContext({ viewport: { width, height }, reducedMotion: "reduce" });
    await context.addInitScript(anyWebGL);
    const page = await context.newPage();
    page.setDefaultTimeout(60_000);
    const problems = [];
    page.on("pageerror", (error) => problems.push(error.message));
    page.on("console", (message) => ["error", "warning"].includes(message.type()) && problems.push(message.text()));
    page.on("requestfailed", (request) => {
      const why = request.failure()?.errorText;
      if (why !== "net::ERR_ABORTED") problems.push(`${request.url()}: ${why}`); // the viewer gives up what is no longer in view
    });
    const answer = await act(page, asked);
    console.log(JSON.stringify({ ...answer, problems }));
  } finally {
    await browser.close();
  }
}

/** A map over the whole window, at rest: `globalThis.map` and `globalThis.layer`. */
export async function openMap(page, { origin, rendering, view, options = {} }) {
  await page.goto(`${origin}/view/${rendering}/`);
  await page.addScriptTag({ url: `${origin}/view/${rendering}/map3d.js` });
  await page.evaluate(async ([base, given]) => {
    document.body.replaceChildren(Object.assign(document.createElement("canvas"), { id: "whole" }));
    Object.assign(document.getElementById("whole").style, { position: "fixed", inset: "0", width: "100vw", height: "100vh" });
    globalThis.map = new map3d.map("whole", given);
    globalThis.layer = new map3d.imageLayer(base).addTo(globalThis.map);
    await new Promise((done) => globalThis.map.once("idle", done));
  }, [`${origin}/tiles/${rendering}`, { ...options, direction: view }]);
}

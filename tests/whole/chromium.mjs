// Runs one page in Chromium with software WebGL2. Arguments: the folder of playwright-core, a JSON document with the parameters of the script.
// A script passes its actions to `runPage`, which prints their result as JSON, with `problems`: the errors and warnings of the page.
import { resolve } from "node:path";

const [folder, parametersJson] = process.argv.slice(2);

const ARGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"];

/** Starts Chromium with the playwright-core in `library`; `hosts`: host name → address with port. */
export async function launch(library, hosts = {}) {
  const { chromium } = await import(`${library}/index.mjs`);
  const rules = Object.entries(hosts).map(([name, address]) => `MAP ${name} ${address}`);
  const args = rules.length > 0 ? [...ARGS, `--host-resolver-rules=${rules.join(",")}`] : ARGS;
  return chromium.launch({ executablePath: resolve(import.meta.dirname, "../../viewer/test/browser/chromium.sh"), args });
}

/** Makes the viewer's page open at once, as in a session that has seen its opening. */
function skipOpening() {
  try {
    sessionStorage.setItem("map3d-opening", "");
  } catch {
    // A page without storage, such as about:blank.
  }
}

/** For use in a page: makes maps draw with WebGL even without a GPU. */
export function anyWebGL() {
  const getContext = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return getContext.call(this, kind, options && { ...options, failIfMajorPerformanceCaveat: false });
  };
  const getParameter = WebGL2RenderingContext.prototype.getParameter;
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    return name === 0x9246 ? "a GPU" : getParameter.call(this, name); // UNMASKED_RENDERER_WEBGL
  };
}

/** Calls `act(page, parameters)`. `parameters.hosts`: host name → address with port; `parameters.size`: size of the window; `parameters.state`: cookies of an earlier page. */
export async function runPage(act) {
  const parameters = JSON.parse(parametersJson);
  const browser = await launch(folder, parameters.hosts);
  try {
    const [width, height] = parameters.size ?? [1000, 700];
    const context = await browser.newContext({ viewport: { width, height }, reducedMotion: "reduce", storageState: parameters.state });
    await context.addInitScript(anyWebGL);
    await context.addInitScript(skipOpening);
    const page = await context.newPage();
    page.setDefaultTimeout(60_000);
    const problems = [];
    page.on("pageerror", (error) => problems.push(error.message));
    page.on("console", (message) => ["error", "warning"].includes(message.type()) && problems.push(message.text()));
    page.on("requestfailed", (request) => {
      const reason = request.failure()?.errorText;
      if (reason !== "net::ERR_ABORTED") problems.push(`${request.url()}: ${reason}`); // the viewer aborts requests for tiles that have left the view
    });
    const result = await act(page, parameters);
    console.log(JSON.stringify({ ...result, problems }));
  } finally {
    await browser.close();
  }
}

/** Opens a map that fills the window, as `globalThis.map` and `globalThis.layer`, and waits until it is idle. */
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

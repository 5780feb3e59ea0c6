// Opens a served rendering at the places of views.json and takes a picture of each. Arguments: playwright-core's folder, address of the page, views.json, folder for the pictures.
import { readFile } from "node:fs/promises";
import { anyWebGL, launch } from "../../tests/whole/chromium.mjs";

const [library, page, list, folder] = process.argv.slice(2);
const { origin } = await (await fetch(`${page}rendering.json`.replace("/view/", "/tiles/"))).json();
const browser = await launch(library);

/** Waits until pictures have come, none is on its way, and nothing has moved for a while. */
async function quiet(tab, act) {
  let [open, images, last] = [0, 0, performance.now()];
  const heard = (step) => () => { [open, last] = [open + step, performance.now()]; };
  const [begun, ended] = [heard(1), heard(-1)];
  const answered = (response) => { images += Number(response.headers()["content-type"]?.startsWith("image/") ?? false); };
  tab.on("request", begun).on("requestfinished", ended).on("requestfailed", ended).on("response", answered);
  const pictures = await act();
  while (open > 0 || images < pictures || performance.now() - last < 2000) await new Promise((done) => setTimeout(done, 100));
  tab.off("request", begun).off("requestfinished", ended).off("requestfailed", ended).off("response", answered);
}

for (const { name, view, at, zoom, size, dpr, click, bare } of JSON.parse(await readFile(list, "utf8"))) {
  const [width, height] = size;
  const context = await browser.newContext({ viewport: { width, height }, deviceScaleFactor: dpr ?? 1, isMobile: dpr !== undefined, hasTouch: dpr !== undefined, colorScheme: "light", bypassCSP: true });
  await context.addInitScript(anyWebGL);
  const tab = await context.newPage();
  tab.on("pageerror", (error) => { throw error; });
  await quiet(tab, async () => {
    await tab.goto(`${page}#${[view, ...at.map((part, k) => part + origin[k]), zoom].join("/")}`);
    return 8;
  });
  if (click) await quiet(tab, async () => { await tab.touchscreen.tap(click[0], click[1]); return 0; });
  if (bare) await tab.addStyleTag({ content: ".card, .map3d-controls { display: none }" });
  await tab.screenshot({ path: `${folder}/${name}.jpg`, type: "jpeg", quality: 85 });
  console.log(`${name}.jpg`);
  await context.close();
}
await browser.close();

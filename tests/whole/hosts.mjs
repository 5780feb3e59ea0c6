// Opens a published folder as visitors of different hosts and browsers do. Parameters: cases: name → { address; language; javaScript: false without it; old: removes a feature of
// browsers; types: { suffix: media type } that the host sends; picture: path of the screenshot; size }. Result: name → { title, sentence }: what the page says in place of the map, or null.
import { anyWebGL, launch } from "./chromium.mjs";

const [folder, parametersJson] = process.argv.slice(2);

async function open(browser, { address, language = "en", javaScript = true, old, types = {}, picture, size = [1000, 700] }) {
  const context = await browser.newContext({ viewport: { width: size[0], height: size[1] }, locale: language, javaScriptEnabled: javaScript, reducedMotion: "reduce", serviceWorkers: "block" });
  await context.addInitScript(anyWebGL);
  if (old) await context.addInitScript((name) => { delete globalThis[name]; }, old);
  const page = await context.newPage();
  for (const [suffix, type] of Object.entries(types)) {
    await page.route(`**/*${suffix}`, async (route) => {
      const response = await route.fetch();
      await route.fulfill({ response, headers: { ...response.headers(), "content-type": type, "x-content-type-options": "nosniff" } });
    });
  }
  await page.goto(address);
  const said = page.locator(".closed p:visible, .failed p:visible").first();
  await Promise.race([said.waitFor(), javaScript ? page.waitForFunction(() => location.hash.length > 5) : said.waitFor()]).catch(() => undefined);
  await page.waitForLoadState("networkidle");
  if (picture) await page.screenshot({ path: picture });
  const result = { title: await page.title(), sentence: await said.count() > 0 ? (await said.innerText()) : null };
  await context.close();
  return result;
}

const { cases } = JSON.parse(parametersJson);
const browser = await launch(folder);
try {
  const results = {};
  for (const [name, asked] of Object.entries(cases)) results[name] = await open(browser, asked);
  console.log(JSON.stringify(results));
} finally {
  await browser.close();
}

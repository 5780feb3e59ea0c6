// Opens a served rendering in Chromium, looks at it, clicks on world positions. Arguments: playwright-core's folder, origin, rendering, view, positions (JSON), picture.
// Prints one JSON document: { problems, clicks: [{ id, name, position, approximate, attributes }] }.
const [folder, origin, rendering, view, positions, picture] = process.argv.slice(2);
const { chromium } = await import(`${folder}/index.mjs`);
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"],
});
const page = await (await browser.newContext({ viewport: { width: 1000, height: 700 } })).newPage();
const problems = [];
page.on("pageerror", (error) => problems.push(error.message));
page.on("console", (message) => message.type() === "error" && problems.push(message.text()));
await page.goto(`${origin}/view/${rendering}/`);
await page.addScriptTag({ url: `${origin}/view/${rendering}/map3d.js` });
await page.evaluate(async ([base, direction]) => {
  document.body.replaceChildren(Object.assign(document.createElement("canvas"), { id: "whole" }));
  Object.assign(document.getElementById("whole").style, { position: "fixed", inset: "0", width: "100vw", height: "100vh" });
  globalThis.map = new map3d.map("whole", { direction });
  new map3d.imageLayer(base).addTo(globalThis.map);
  await new Promise((done) => globalThis.map.once("idle", done));
}, [`${origin}/tiles/${rendering}`, view]);
await page.screenshot({ path: picture });
const clicks = [];
for (const position of JSON.parse(positions)) {
  const at = await page.evaluate(async (world) => {
    const { map } = globalThis;
    map.setView(world, 0);
    await new Promise((done) => setTimeout(done, 600)); // longer than two taps of a double tap lie apart
    globalThis.clicked = new Promise((done, failed) => {
      map.once("click", ({ id, name, position, approximate, attributes }) => done({ id, name, position, approximate, attributes }));
      setTimeout(() => failed(new Error(`no click event at ${map.project(world)} after 20 s`)), 20_000);
    });
    return map.project(world);
  }, position);
  await page.mouse.click(at[0], at[1]);
  clicks.push(await page.evaluate(() => globalThis.clicked));
}
console.log(JSON.stringify({ problems, clicks }));
await browser.close();

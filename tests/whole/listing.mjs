// Opens a page that creates `map` and `layer` itself. Parameters: hosts, page, picture (path of the screenshot), positions (world positions to click).
// Result: hosts: number of tiles by host; markers: labels; points: screen positions of `positions`; clicks.
import { runPage } from "./chromium.mjs";

await runPage(async (page, { page: address, picture, positions }) => {
  const hosts = {};
  page.on("response", (response) => {
    const { hostname, pathname } = new URL(response.url());
    if (response.ok() && pathname.startsWith("/tiles/") && !pathname.endsWith(".json")) hosts[hostname] = (hosts[hostname] ?? 0) + 1;
  });
  await page.goto(address);
  await page.evaluate(() => new Promise((done) => globalThis.map.once("idle", done)));
  await page.screenshot({ path: picture });
  const markers = await page.evaluate(() => [...document.querySelectorAll(".map3d-marker")].map((found) => found.textContent));
  const points = await page.evaluate((places) => {
    const { left, top } = globalThis.map.container.getBoundingClientRect();
    return places.map((place) => globalThis.map.project(place)).map(([x, y]) => [x + left, y + top]);
  }, positions);
  const clicks = [];
  for (const [x, y] of points) {
    await page.waitForTimeout(600); // longer than the interval of a double tap
    await page.evaluate(() => {
      globalThis.clicked = new Promise((done) => globalThis.map.once("click", ({ id, name, position, approximate }) => done({ id, name, position, approximate })));
    });
    await page.mouse.click(x, y);
    clicks.push(await page.evaluate(() => globalThis.clicked));
  }
  return { hosts, markers, points, clicks };
});

// Opens a served rendering and clicks on world positions. Parameters: origin, rendering, view, positions, picture. Result: clicks: [{ id, name, position, approximate, attributes }].
import { runPage, openMap } from "./chromium.mjs";

await runPage(async (page, { origin, rendering, view, positions, picture }) => {
  await openMap(page, { origin, rendering, view });
  await page.screenshot({ path: picture });
  const clicks = [];
  for (const position of positions) {
    const at = await page.evaluate(async (world) => {
      const { map } = globalThis;
      map.setView(world, 0);
      await new Promise((done) => setTimeout(done, 600)); // longer than the interval of a double tap
      globalThis.clicked = new Promise((done, failed) => {
        map.once("click", ({ id, name, position, approximate, attributes }) => done({ id, name, position, approximate, attributes }));
        setTimeout(() => failed(new Error(`no click event at ${map.project(world)} after 20 s`)), 20_000);
      });
      return map.project(world);
    }, position);
    await page.mouse.click(at[0], at[1]);
    clicks.push(await page.evaluate(() => globalThis.clicked));
  }
  return { clicks };
});

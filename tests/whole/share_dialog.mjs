// Opens a link with a view in its query, then the share dialog, on a screen of the given size.
import { runPage } from "./chromium.mjs";

await runPage(async (page, { origin, rendering, view, screenshot }) => {
  await page.goto(`${origin}/view/${rendering}/?view=${view}`);
  await page.waitForSelector("#share", { state: "visible" });
  const opened = page.url();
  await page.click("#share");
  await page.waitForFunction(() => {
    const images = [...document.querySelectorAll(".share-dialog img")];
    return images.length === 2 && images.every(({ complete }) => complete);
  });
  const seen = await page.evaluate(() => {
    const box = document.querySelector(".share-dialog").getBoundingClientRect();
    return {
      link: document.querySelector("#share-link").value,
      embed: document.querySelector("#share-embed").value,
      sizes: [...document.querySelectorAll(".share-dialog img")].map(({ naturalWidth, naturalHeight }) => [naturalWidth, naturalHeight]),
      inside: box.left >= 0 && box.right <= innerWidth && box.top >= 0 && box.bottom <= innerHeight,
    };
  });
  await page.screenshot({ path: screenshot });
  await page.goto(seen.link);
  await page.waitForSelector("#share", { state: "visible" });
  const again = page.url();
  await page.waitForLoadState("networkidle"); // requests of a page that is replaced would fail
  // A page without a map, whose policy allows no style attribute, stands for the page of another author.
  await page.goto(`${origin}/studio/`);
  await page.setContent(`<!doctype html>${seen.embed.replace(/ style="[^"]*"/, "")}`);
  const frame = page.frameLocator("iframe");
  await frame.locator("#share").waitFor({ state: "visible" });
  return { ...seen, opened, again };
});

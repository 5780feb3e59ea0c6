// Opens the page of a published folder as a visitor does. Parameters: address; direction (a view id), position and zoom of an object to click; label to search for; picture: path prefix of the screenshots; size.
// Result: title; clicked, found: the texts of the panel, and whether it covers buttons; turned: the view id in the address after turning; pictures: number of different screenshots; ranges: number of 206 responses.
import { runPage } from "./chromium.mjs";

const REST_MS = 200;

/** Waits until no request is pending and the image no longer changes; returns the screenshot. */
async function settle(page, path) {
  await page.waitForLoadState("networkidle");
  for (let before = "", now = ""; ; before = now) {
    now = (await page.screenshot(path ? { path } : {})).toString("base64");
    if (now === before) return now;
    await page.waitForTimeout(REST_MS);
  }
}

async function panel(page) {
  await page.waitForSelector("#info:not([hidden])");
  const [name, note] = await Promise.all(["#info h2", "#info .note"].map((place) => page.locator(place).first().textContent()));
  const [keys, values] = await Promise.all(["#info dt", "#info dd"].map((place) => page.locator(place).allTextContents()));
  const [box, buttons] = await Promise.all(["#info", ".map3d-buttons"].map((place) => page.locator(place).boundingBox()));
  const covers = box.y + box.height > buttons.y && box.x + box.width > buttons.x;
  const attributes = Object.fromEntries(keys.map((key, k) => [key, values[k]]));
  return { name: attributes["gml:id"] ?? name, note, covers, attributes };
}

await runPage(async (page, { address, direction, position, zoom, label, picture, size }) => {
  let ranges = 0;
  page.on("response", (response) => (ranges += response.status() === 206));
  await page.goto(address);
  await page.waitForFunction(() => location.hash.length > 5);
  const whole = await settle(page, `${picture}-whole.png`);
  const title = await page.title();

  await page.goto(`${address}#${[direction, ...position, zoom].join("/")}`);
  await page.reload(); // the page reads the position in the address when it opens
  await page.waitForFunction(() => document.title !== "map3d");
  const near = await settle(page, `${picture}-near.png`);
  await page.mouse.click(size[0] / 2, size[1] / 2);
  const clicked = await panel(page);
  await settle(page, `${picture}-click.png`);
  await page.keyboard.press("Escape");

  await page.fill("#query", label);
  await page.waitForSelector("#results li[role=option]");
  await page.keyboard.press("Enter");
  const found = await panel(page);
  const searched = await settle(page, `${picture}-search.png`);
  await page.keyboard.press("Escape");

  await page.getByRole("button", { name: "Turn view counter-clockwise" }).click();
  await page.waitForFunction((before) => !location.hash.startsWith(`#${before}/`), direction);
  const turned = await settle(page, `${picture}-turned.png`);
  const hash = await page.evaluate(() => location.hash);
  return { title, clicked, found, ranges, turned: hash.slice(1).split("/")[0], pictures: new Set([whole, near, searched, turned]).size };
});

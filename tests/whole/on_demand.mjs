// Opens the page of a served rendering and waits until no request is pending and the image no longer changes. Parameters: address; picture: path of the screenshot; size.
// Result: statuses: HTTP status → number of responses to requests for tiles.
import { runPage } from "./chromium.mjs";

const REST_MS = 300;

await runPage(async (page, { address, picture }) => {
  const statuses = {};
  page.on("response", (response) => {
    if (/\/\d+\/\d+\/\d+(\?|$)/.test(response.url())) statuses[response.status()] = (statuses[response.status()] ?? 0) + 1;
  });
  await page.goto(address);
  await page.waitForFunction(() => location.hash.length > 5);
  for (let before = "", now = ""; before === "" || now !== before;) {
    await page.waitForLoadState("networkidle");
    before = now;
    now = (await page.screenshot({ path: picture })).toString("base64");
    await page.waitForTimeout(REST_MS);
  }
  return { statuses };
});

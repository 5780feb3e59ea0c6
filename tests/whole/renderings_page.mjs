// Opens the list of renderings. Parameters: origin, path, size, pictures: file names for the light and the dark scheme.
// Result: url, titles, images: whether each preview is loaded, overflow: whether the page is wider than the window, requests: paths of failed requests.
import { runPage } from "./chromium.mjs";

await runPage(async (page, { origin, path, pictures }) => {
  const requests = [];
  page.on("response", (response) => response.status() >= 400 && requests.push(new URL(response.url()).pathname));
  await page.goto(`${origin}${path}`, { waitUntil: "networkidle" });
  for (const [scheme, picture] of Object.entries(pictures)) {
    await page.emulateMedia({ colorScheme: scheme });
    await page.screenshot({ path: picture });
  }
  const found = await page.evaluate(() => ({
    url: location.pathname,
    titles: [...document.querySelectorAll("h2")].map((title) => title.textContent),
    images: [...document.querySelectorAll("img.preview")].map((image) => image.complete && image.naturalWidth === 1200),
    overflow: document.documentElement.scrollWidth > innerWidth,
  }));
  return { ...found, requests };
});

// The end of the story: open a shared link, publish, delete all. Parameters: origin, link, name: of scene and rendering, state: cookies of the first part, size,
// pictures: a folder. Result: linked: what the map says of the link's object, what the pages said, and what `watch` saw.
import { runPage } from "./chromium.mjs";
import { watch } from "./studio_pages.mjs";

await runPage(async (page, { origin, link, name, pictures, label }) => {
  const { failed, overflow, look, idle, text, settled } = watch(page, `${pictures}/web-interface-${label}`);

  // The link shows the same object.
  await page.goto(link);
  await page.waitForSelector("#info:not([hidden])");
  await page.click("#info summary");
  const linked = await text("#info");
  await settled();
  await look("link", false);

  // Publish.
  await page.goto(`${origin}/studio/renderings/${name}`);
  await page.getByRole("button", { name: "Publish", exact: true }).click();
  await page.waitForURL(`**/renderings/${name}`);
  await idle();
  const published = await text("#operations .detail");
  await look("published");

  // Delete all.
  for (const kind of ["renderings", "scenes"]) {
    await page.goto(`${origin}/studio/${kind}/${name}/remove`);
    await page.getByLabel("to confirm").fill(name);
    if (kind === "scenes") await look("remove");
    await page.getByRole("button", { name: "Remove", exact: true }).click();
    await page.waitForFunction(() => !location.pathname.endsWith("/remove"));
    await idle();
  }
  const left = await text("main");
  await look("empty");
  await page.getByRole("button", { name: "Sign out" }).click();
  await page.waitForURL(`${origin}/renderings`);
  return { linked, published, left, overflow, failed };
});

// A user's way from files to a map: sign in, create a scene, upload an archive over a connection that breaks, read the report, choose a rendering by its preview,
// watch it, open the map, click a building, share the view. Parameters: origin, name, password, archive, crs, size, pictures: a folder, breaks: whether to break the first piece.
// Result: what each page said, building: what the map says of the object, url: of the map, link: of the shared view, cookies, and what `watch` saw.
import { runPage } from "./chromium.mjs";
import { watch } from "./studio_pages.mjs";

await runPage(async (page, { origin, name, password, archive, pictures, label, crs, breaks, res }) => {
  const { failed, overflow, look, idle, text, settled } = watch(page, `${pictures}/web-interface-${label}`);

  // Sign in; the page that was asked for follows.
  await page.goto(`${origin}/studio/`);
  await look("sign-in");
  await page.fill("[name=name]", name);
  await page.fill("[name=password]", password);
  await page.keyboard.press("Enter");
  await page.waitForURL(`${origin}/studio/`);
  await look("home");

  // A scene.
  await page.getByRole("link", { name: "New scene" }).click();
  await page.getByLabel("Title", { exact: true }).fill("The story");
  if (crs) await page.getByLabel("Coordinate system", { exact: true }).fill(crs);
  await look("new-scene");
  await page.getByRole("button", { name: "Create scene" }).click();
  await page.waitForURL("**/scenes/the-story");

  // An upload whose first piece is lost with its connection.
  let broken = 0;
  await page.route("**/uploads/*", async (route) => {
    if (breaks && route.request().method() === "PATCH" && broken++ === 0) await route.abort("connectionreset");
    else await route.continue();
  });
  await page.locator("[data-pick]").first().setInputFiles(archive);
  if (crs) {
    await page.getByText("Options", { exact: true }).click();
    await page.getByLabel("Coordinate system of the files").fill(crs);
  }
  await look("upload");
  await page.getByRole("button", { name: "Upload and import" }).click();
  await page.waitForSelector(".operation");
  await idle();
  const imported = await text("#operations li:last-child .detail");
  await look("scene");

  // The report of the first file.
  await page.locator("#files li a").first().click();
  const report = await text("main");
  await look("report");
  await page.goBack();

  // A rendering, chosen by its preview.
  await page.getByRole("link", { name: "New rendering" }).click();
  await page.waitForSelector("#estimate strong", { timeout: 60_000 });
  const before = await page.getAttribute("#detail", "src");
  await page.fill("[name=res]", String(res));
  await page.locator("[name=directions][value='2']").check({ force: true });
  await page.waitForFunction((old) => document.getElementById("detail").getAttribute("src") !== old, before);
  await page.waitForFunction(() => !document.querySelector("img[aria-busy]") && document.querySelector("#estimate strong"), null, { timeout: 60_000 });
  const estimate = await text("#estimate");
  const sizes = await page.evaluate(() => [...document.querySelectorAll("figure img")].map((image) => image.naturalWidth));
  await look("preview");
  await page.getByRole("button", { name: "Create and render" }).click();
  await page.waitForURL("**/renderings/the-story");
  await idle();
  const state = await text("#state");
  await look("rendering");

  // The map: a click on a building names it. The map is in the middle of the window at first.
  await page.getByRole("link", { name: "Open map" }).click();
  await page.waitForURL("**/view/the-story/");
  await page.waitForSelector("canvas");
  const { width, height } = page.viewportSize();
  await page.waitForLoadState("networkidle");
  let building = "";
  for (let tries = 0; !building && tries < 80; tries++) {
    const angle = 2.4 * tries, radius = 0.03 * Math.sqrt(tries) * Math.min(width, height);
    await page.mouse.click(width / 2 + radius * Math.cos(angle), height / 2 + radius * Math.sin(angle));
    await page.waitForTimeout(300);
    building = await page.evaluate(() => { const info = document.getElementById("info"); if (info.hidden || !/building|roof|wall/i.test(info.innerText)) return ""; info.querySelector("details").open = true; return info.innerText; });
  }
  await settled();
  await look("map");
  const url = page.url();

  // Share the view.
  await page.click("#share");
  await page.waitForFunction(() => {
    const images = [...document.querySelectorAll(".share-dialog img")];
    return images.length === 2 && images.every(({ complete, naturalWidth }) => complete && naturalWidth > 0);
  });
  const link = await page.inputValue("#share-link");
  await settled();
  await look("share", false);
  return { imported, report, estimate, sizes, state, building, url, link, cookies: await page.context().storageState(), broken, overflow, failed };
});

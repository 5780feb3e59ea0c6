// Takes the pictures of the web interface: uploads a ZIP archive into a new scene and creates a rendering, as a person would. Standard input: { playwright: folder,
// address: of the server, user, password, archive: path of the ZIP archive, title: of the scene, out: output folder }.
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { launch } from "../../tests/whole/chromium.mjs";

const { playwright, address, user, password, archive, title, out } = JSON.parse(readFileSync(0, "utf8"));
const LIMIT_MS = 400_000;
const DESK = { viewport: { width: 1280, height: 800 } };
const PHONE = { viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, isMobile: true, hasTouch: true };
const browser = await launch(playwright);

const shoot = (page, name) => page.screenshot({ path: join(out, `${name}.png`), fullPage: true });
/** Waits until all operations that the page shows have ended. */
const idle = (page) => page.waitForFunction(() => !document.getElementById("main").hasAttribute("data-poll"));
const complete = (page) => page.waitForFunction(() => [...document.images].every((image) => image.complete && image.naturalWidth > 0));

/** Opens a page of a window in which the user is signed in. */
async function signIn(window) {
  const context = await browser.newContext({ ...window, locale: "en-GB", colorScheme: "light" });
  const page = await context.newPage();
  page.setDefaultTimeout(LIMIT_MS);
  page.on("pageerror", (error) => { throw error; });
  await page.goto(`${address}/studio/`);
  await page.getByLabel("Name").fill(user);
  await page.getByLabel("Password").fill(password);
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.waitForURL(/studio\/$/);
  return page;
}

try {
  const page = await signIn(DESK);
  await page.goto(`${address}/studio/scenes/new`);
  await page.getByLabel("Title").fill(title);
  await page.getByRole("button", { name: "Create scene" }).click();
  await page.locator("#upload [data-pick]").first().setInputFiles(archive);
  await page.locator("[data-start]").click();
  await page.waitForFunction(() => document.querySelector("#files li") && document.querySelector("#renderings a.primary"));
  await idle(page);

  await page.getByRole("link", { name: "New rendering" }).click();
  await page.waitForFunction(() => document.querySelector("#estimate strong"));
  await complete(page);
  await shoot(page, "studio-new-rendering");
  await page.getByRole("button", { name: "Create and render" }).click();
  await page.waitForURL(/studio\/renderings\//);
  await idle(page);
  const rendering = page.url();
  await page.locator("#publish button").click();
  await page.waitForFunction(() => document.querySelector("#publish li"));
  await idle(page);
  await page.locator(".crumbs a").last().click();
  await complete(page);
  await shoot(page, "studio-scene");

  const phone = await signIn(PHONE);
  await phone.goto(rendering);
  await complete(phone);
  await shoot(phone, "studio-phone");
} finally {
  await browser.close();
}

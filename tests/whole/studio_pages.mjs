// What the stories of the web interface share.

const STILL_MS = 500, STILL_TRIES = 60, OPERATION_MS = 400_000;

/** Watches a page. `failed`: refused requests, `overflow`: steps at which the page was wider than the window, filled as the story runs. */
export function watch(page, pictures) {
  const failed = [], overflow = [];
  page.on("response", (response) => response.status() >= 400 && failed.push(`${response.status()} ${new URL(response.url()).pathname}`));
  return {
    failed,
    overflow,
    text: (selector) => page.locator(selector).first().innerText(),

    /** Takes a picture of a step. */
    async look(step, fullPage = step !== "map") {
      await page.evaluate(() => document.activeElement?.blur());
      if (await page.evaluate(() => document.documentElement.scrollWidth > innerWidth)) overflow.push(step);
      await page.screenshot({ path: `${pictures}-${step}.png`, fullPage });
    },

    /** Waits until all operations that the page shows have ended. */
    async idle() {
      await page.waitForFunction(() => !document.getElementById("main").hasAttribute("data-poll"), null, { timeout: OPERATION_MS });
    },

    /** Waits until two pictures of the page are equal. */
    async settled() {
      let before = await page.screenshot();
      for (let tries = 0; tries < STILL_TRIES; tries++) {
        await page.waitForTimeout(STILL_MS);
        const now = await page.screenshot();
        if (now.equals(before)) return;
        before = now;
      }
      throw new Error("the page did not come to rest");
    },
  };
}

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import type { AxeResults } from "axe-core";
import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { renderTown } from "../fixture/rendering";
import { THINGS } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { animationsEnd } from "./page";

const bed = new TestBed({ town: renderTown(256, 0.38) }, { draws: false });
const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const DEVICES = {
  desk: { viewport: { width: 1280, height: 800 } },
  phone: { viewport: { width: 390, height: 844 }, deviceScaleFactor: 1, isMobile: true, hasTouch: true },
};

/** The violations of WCAG 2 A and AA that axe-core finds: the rule, and the elements. */
async function violations(page: Page): Promise<string[]> {
  await page.evaluate(AXE);
  const found = await page.evaluate(async () => {
    const { axe } = globalThis as unknown as { axe: { run(context: Document, options: object): Promise<AxeResults> } };
    const { violations, passes } = await axe.run(document, { runOnly: ["wcag2a", "wcag2aa"] });
    return {
      passes: passes.length,
      violations: violations.flatMap(({ id, nodes }) =>
        nodes.map(({ target, failureSummary }) => `${id}: ${target.join(" ")}: ${failureSummary ?? ""}`),
      ),
    };
  });
  expect(found.passes).toBeGreaterThan(10);
  return found.violations;
}

test.each(Object.entries(DEVICES))("%s: axe-core finds no violation of WCAG 2 A and AA on the page", async (device, context) => {
  const { page } = await bed.openReadyMade(bed.url("town"), { ...context, locale: "en-GB" });
  const found: Record<string, string[]> = {};
  const look = async (state: string): Promise<void> => {
    await animationsEnd(page);
    await page.screenshot({ path: `${OUT}/axe-${device}-${state}.png` });
    found[state] = await violations(page);
  };
  await look("start");
  await page.locator("#more").click();
  await look("settings");
  await page.locator("#more").click();
  await page.evaluate((id) => {
    location.hash = `${location.hash.split("/id=")[0] ?? ""}/id=${String(id)}`;
  }, THINGS[1]?.id ?? 0);
  await page.waitForSelector("#info:not([hidden])");
  await look("card");
  await page.locator("#make-picture").click();
  await look("image");
  await page.keyboard.press("Escape");
  expect(found).toEqual({ start: [], settings: [], card: [], image: [] });
});

test("axe-core finds a control without a name", async () => {
  const { page } = await bed.openPage(DEVICES.desk);
  await page.goto(`${bed.server.origin}/?rendering=${bed.url("town")}`);
  await page.waitForSelector("#tools:not([hidden])");
  await page.evaluate(() => {
    document.querySelector("#tools")?.append(document.createElement("button"));
  });
  expect((await violations(page)).filter((text) => text.startsWith("button-name"))).toHaveLength(1);
});

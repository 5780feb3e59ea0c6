import { expect, test } from "vitest";
import { devices, type Page } from "playwright-core";
import { renderTown, type Fixture } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { OUT, resting } from "./browser";
import { steady } from "./page";

const drawn = new TestBed({ town: renderTown(256, 0.38), unnamed: withoutNames(renderTown(256, 0.38)) });
const bed = new TestBed(drawn.server, { draws: false });

/** The same rendering: the tower has an address, the chapel a function, and the school is a part of the town hall. */
function withoutNames(fixture: Fixture): Fixture {
  const edit = (path: string, change: (json: { objects: Record<string, Record<string, unknown>>; entries: unknown[] }) => void): void => {
    const json = JSON.parse(new TextDecoder().decode(fixture.files.get(path))) as Parameters<typeof change>[0];
    change(json);
    fixture.files.set(path, new TextEncoder().encode(JSON.stringify(json)));
  };
  const put = (id: number, change: object): void => {
    edit(`objects/${String(Math.floor(id / 1024))}.json`, ({ objects }) => {
      Object.assign(objects[String(id)] as object, change);
    });
  };
  put(2_000_000_001, { name: "DEBY_LOD2_4959323", attributes: { address: "Marktplatz 1" } });
  put(3_900_000_007, { name: "UUID_77", attributes: { function: "Kirche" } });
  put(1025, { parent: 17 });
  edit("objects/search.json", (json) => {
    json.entries = [
      [3_900_000_007, "Kirche", [-28, 47, 20], "uuid 77 church eglise"],
      [2_000_000_001, "Marktplatz 1", [32, 26, 62], "deby lod2 4959323"],
      [17, "building", [-45, -4, 34], "school old"],
    ];
  });
  return fixture;
}

// Two device pixels per CSS pixel: three take twice as long without a GPU, and only few tests need them.
const PHONE = {
  viewport: { width: 390, height: 844 },
  deviceScaleFactor: 2,
  isMobile: true,
  hasTouch: true,
  userAgent: devices["iPhone 14"].userAgent,
};
const DESK = { viewport: { width: 1280, height: 800 } };
/** For tests that look at pixels. */
const SMALL = { viewport: { width: 800, height: 500 } };

/** The page with the town, at rest. */
const open = (options: object, query = bed.url("town"), from = bed): Promise<{ page: Page; problems: string[] }> =>
  from.openReadyMade(query, options);

for (const [name, options] of [
  ["desk", DESK],
  ["phone", PHONE],
  ["dark", { ...DESK, colorScheme: "dark" }],
] as const) {
  test(`${name}: the page opens, searches, shows and closes an object without browser or CSP errors`, async () => {
    const { page, problems } = await open(options);
    await page.screenshot({ path: `${OUT}/${name}-open.png` });
    expect(await page.title()).toBe("A small town");
    await page.fill("#query", "SCHOOL old");
    await page.waitForSelector("#results li");
    await page.screenshot({ path: `${OUT}/${name}-search.png` });
    expect(await page.locator("#results li").allTextContents()).toEqual(["School <b>old</b>"]);
    await page.keyboard.press("Enter");
    await page.waitForSelector("#info:not([hidden])");
    await steady(page, () => page.locator(".map3d-marker").boundingBox(), 3);
    await page.screenshot({ path: `${OUT}/${name}-info.png` });
    expect(await page.locator("#info h2").textContent()).toBe("School <b>old</b>");
    expect(await page.locator("#info img").count()).toBe(0);
    expect(await page.locator(".map3d-marker").allTextContents()).toEqual([expect.stringContaining("School <b>old</b>")]);
    const pin = (await page.locator(".map3d-marker").boundingBox()) as { x: number; y: number; width: number; height: number };
    await page.locator("#info .close").click();
    expect(await page.locator(".map3d-marker").count()).toBe(0);
    await page.mouse.click(pin.x + pin.width / 2 - 60, pin.y + pin.height + 60);
    await page.waitForSelector("#info:not([hidden])");
    await page.screenshot({ path: `${OUT}/${name}-click.png` });
    expect(await page.locator("#info details dd").count()).toBe(6);
    await page.keyboard.press("Escape");
    expect(await page.locator("#info").isHidden()).toBe(true);
    expect(problems).toEqual([]);
  });
}

test("the light slider and the display mode change the picture", async () => {
  const { page } = await open(SMALL, bed.url("town"), drawn);
  const shots: string[] = [];
  /** Waits for a picture that has not been shown before. */
  const changed = async (name: string): Promise<void> => {
    let shot = "";
    await expect
      .poll(
        async () => {
          shot = (await page.screenshot({ path: `${OUT}/${name}.png`, clip: { x: 240, y: 100, width: 320, height: 300 } })).toString(
            "base64",
          );
          return shots.includes(shot);
        },
        { timeout: 60_000, interval: 300 },
      )
      .toBe(false);
    shots.push(shot);
  };
  await changed("mode-lit");
  await page.locator("#time").fill("19");
  expect(await page.locator("#clock").textContent()).toBe("19:00");
  await changed("mode-evening");
  await page.locator("#more").click();
  for (const mode of ["color", "normal", "id", "depth"]) {
    await page.locator(`#modes input[value=${mode}]`).check({ force: true });
    await changed(`mode-${mode}`);
  }
  expect(await page.locator("#time").isDisabled()).toBe(true);
});

test("shadows that are found from depth can be switched off", async () => {
  const { page } = await open(DESK, bed.url("town"), drawn);
  await page.waitForSelector("#shadows");
  const [lit, box] = [await page.locator("#mapcanvas").screenshot(), page.locator("#shadows")];
  await box.uncheck();
  await expect.poll(async () => (await page.locator("#mapcanvas").screenshot()).equals(lit), { timeout: 20_000 }).toBe(false);
  expect(await box.isChecked()).toBe(false);
});

test("a bar shows that a turn waits for its tiles", async () => {
  const { page } = await open({ ...DESK, reducedMotion: "reduce" });
  await page.waitForSelector("#loading", { state: "hidden" });
  const release = bed.server.hold("/180-45/");
  try {
    await page.evaluate(() => {
      document.querySelector<HTMLElement>("#mapcanvas")?.focus();
    });
    await page.evaluate(() => {
      location.hash = location.hash.replace("0-45", "90-45");
    });
    await page.waitForSelector("#loading", { state: "hidden" });
    await page.getByRole("button", { name: "Turn view counter-clockwise" }).click();
    await page.waitForSelector("#loading", { state: "visible" });
    await page.screenshot({ path: `${OUT}/page-loading.png` });
  } finally {
    release();
  }
  await page.waitForSelector("#loading", { state: "hidden" });
  await page.waitForFunction(() => location.hash.startsWith("#180-45/"));
});

test("a missing rendering shows a message", async () => {
  const { page } = await bed.openPage(PHONE);
  await page.goto(`${bed.server.origin}/?rendering=/tiles/nowhere`);
  await page.waitForSelector(".failed");
  expect(await page.locator(".failed").textContent()).toContain("HTTP 404");
  await page.screenshot({ path: `${OUT}/failed.png` });
});

test("controls are at least 44 pixels large and have names", async () => {
  const { page } = await open(PHONE);
  const small = await page.evaluate(() =>
    [...document.querySelectorAll<HTMLElement>("button, input")]
      .filter((found) => found.offsetParent !== null)
      .flatMap((found) => {
        const area = found.matches("#modes input") ? (found.parentElement as HTMLElement) : found;
        const { width, height } = area.getBoundingClientRect();
        const tall = found.matches("#modes input") ? height + 12 : height;
        const named = found.getAttribute("aria-label") ?? found.textContent;
        return width < 44 || tall < 44 || (named === "" && !found.matches("#modes input"))
          ? [`${found.outerHTML.slice(0, 80)} ${String(width)} × ${String(height)}`]
          : [];
      }),
  );
  expect(small).toEqual([]);
});

test("the first phone view costs less than 1 MB with the script and the manifest", async () => {
  const { page } = await bed.openPage({ ...PHONE, deviceScaleFactor: 3 }, { maps: true });
  const session = await page.context().newCDPSession(page);
  await session.send("Network.enable");
  let bytes = 0;
  session.on("Network.loadingFinished", ({ encodedDataLength }) => {
    bytes += encodedDataLength;
  });
  await page.goto(`${bed.server.origin}/?rendering=${bed.url("town")}`);
  await resting(page);
  console.log(`first phone view: ${String(bytes)} bytes`);
  expect(bytes).toBeGreaterThan(50_000);
  expect(bytes).toBeLessThan(1_000_000);
});

test("view, time and selection are in the URL; the back button undoes a selection", async () => {
  const { page, problems } = await open(DESK);
  await page.fill("#query", "Tower");
  await page.waitForSelector("#results li");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#info:not([hidden])");
  await page.locator("#time").fill("9");
  await page.waitForFunction(() => location.hash.includes("/id=2000000001") && /\/t=[-\d]+T\d\d:\d\dZ/.test(location.hash));
  await resting(page);
  const shared = page.url();
  const { page: other } = await bed.openPage(DESK, { maps: true });
  await other.goto(shared);
  await other.waitForSelector("#info:not([hidden])");
  expect(await other.locator("#info h2").textContent()).toBe("Tower");
  expect(await other.locator("#clock").textContent()).toBe("9:00");
  await resting(other);
  expect(other.url()).toBe(shared);
  await page.goBack();
  await page.waitForSelector("#info", { state: "hidden" });
  expect(page.url()).not.toContain("id=");
  expect(problems).toEqual([]);
});

test("changing the URL fragment changes the view", async () => {
  const { page, problems } = await open(DESK);
  const place = "#90-45/691032.0/5336026.0/562.0/4.00";
  await page.evaluate((hash) => {
    location.hash = hash;
  }, place);
  await page.waitForFunction(() =>
    [...(globalThis as unknown as { maps: Set<{ direction: string }> }).maps].some(({ direction }) => direction === "90-45"),
  );
  await resting(page);
  const [, direction, x, y, z, zoom] = /^#(.+?)\/(.+?)\/(.+?)\/(.+?)\/(.+?)\//.exec(`${await page.evaluate(() => location.hash)}/`) ?? [];
  expect([direction, zoom]).toEqual(["90-45", "4.00"]);
  // The visible surface at the centre can be anywhere along the ray: looking west at 45 degrees, x − z is constant.
  expect(Number(x) - Number(z)).toBeCloseTo(691_032 - 562, -0.5);
  expect(Number(y)).toBeCloseTo(5_336_026, -0.5);
  expect(problems).toEqual([]);
});

for (const [name, options] of [
  ["desk", DESK],
  ["phone", PHONE],
] as const) {
  test(`${name}: objects are coloured by an attribute; the legend filters; the URL keeps it`, async () => {
    const { page, problems } = await open(options);
    if (name === "phone") {
      expect(await page.locator("#color-by").isVisible()).toBe(false);
      await page.locator("#more").tap();
    }
    const names = await page.locator("#color-by option").allTextContents();
    expect(names).toEqual(["–", "Class", "measuredHeight", "roofType"]);
    await page.selectOption("#color-by", { label: "measuredHeight" });
    await page.waitForSelector("#legend button");
    await page.screenshot({ path: `${OUT}/${name}-colors.png` });
    expect(await page.locator("#legend button").allTextContents()).toEqual(["2", "16", "20", "34", "62"]);
    await page.locator("#legend button").nth(3).click();
    if (name === "phone") await page.locator("#more").tap();
    await page.screenshot({ path: `${OUT}/${name}-filter.png` });
    expect(await page.locator("#legend button[aria-pressed=true]").allTextContents()).toEqual(["34"]);
    await page.waitForFunction(() => location.hash.endsWith("/by=measuredHeight"));
    const { page: other } = await bed.openPage(options);
    await other.goto(page.url());
    await other.waitForSelector("#legend button");
    expect(await other.locator("#color-by").inputValue()).toBe("measuredHeight");
    if (name === "phone") await page.locator("#more").tap();
    await page.selectOption("#color-by", { label: "–" });
    await page.waitForFunction(() => !location.hash.includes("by=") && document.querySelector("#legend button") === null);
    expect(problems).toEqual([]);
  });
}

test.each([
  ["de-CH", ["Suchen", "Vergrößern", "Licht", "Messen"]],
  ["fr-FR", ["Rechercher", "Zoom avant", "Lumière", "Mesurer"]],
])("the page uses the language and number format of %s", async (locale, [search, zoomIn, lit, line]) => {
  const { page, problems } = await open({ ...DESK, locale });
  expect(await page.evaluate(() => document.documentElement.lang)).toBe(locale);
  expect(await page.locator("#query").getAttribute("placeholder")).toBe(search);
  expect(await page.getByRole("button", { name: zoomIn as string }).count()).toBe(1);
  expect(await page.locator("#modes label").first().textContent()).toBe(lit);
  expect(await page.locator("#measure").textContent()).toBe(line);
  await page.screenshot({ path: `${OUT}/page-${locale}.png` });
  await page.fill("#query", "Tower");
  await page.waitForSelector("#results li");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#info:not([hidden])");
  expect(await page.locator("#info details dd").first().textContent()).toMatch(
    locale === "fr-FR" ? /^6910\d\d,\d\d; 53360\d\d,\d\d$/ : /^6910\d\d\.\d\d, 53360\d\d\.\d\d$/,
  );
  const english = await page.evaluate(() =>
    [...document.querySelectorAll<HTMLElement>("button, input, select, [role]")]
      .map((found) => found.getAttribute("aria-label") ?? "")
      .filter((label) => /\b(the|of|view|search|look|light)\b/i.test(label)),
  );
  expect(english).toEqual([]);
  expect(problems).toEqual([]);
});

test("objects in view can be listed and selected with the keyboard alone", async () => {
  const { page, problems } = await open(DESK);
  await page.locator("#list-in-view").focus();
  await page.keyboard.press("Shift+Tab");
  await page.keyboard.press("Tab");
  await page.screenshot({ path: `${OUT}/desk-skip.png` });
  await page.keyboard.press("Enter");
  await page.waitForSelector("#in-view li");
  await page.screenshot({ path: `${OUT}/desk-seen.png` });
  const names = await page.locator("#in-view button").allTextContents();
  expect([...names].sort()).toEqual(["Chapel", "School <b>old</b>", "Tower", "Town hall"]);
  await page.keyboard.press("Escape");
  expect(await page.locator("#in-view").isHidden()).toBe(true);
  expect(await page.evaluate(() => document.activeElement?.id)).toBe("list-in-view");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#in-view li");
  await page.locator("#in-view button", { hasText: "Tower" }).focus();
  await page.keyboard.press("Enter");
  await page.waitForSelector("#info:not([hidden])");
  expect(await page.locator("#info h2").textContent()).toBe("Tower");
  expect(problems).toEqual([]);
});

test("Enter picks what is at the centre of the map", async () => {
  const { page, problems } = await open(DESK, `${bed.url("town")}#0-45/691032.0/5336026.0/562.0/2.50`);
  await page.locator(".map3d").focus();
  await page.keyboard.press("Enter");
  await page.waitForSelector("#info:not([hidden])");
  expect(await page.locator("#info h2").textContent()).toBe("Tower");
  expect(problems).toEqual([]);
});

test("search, pins and the list show what people say, and never an identifier", async () => {
  const { page, problems } = await open(DESK, bed.url("unnamed"));
  for (const [text, result, pin] of [
    ["église", "Kirche", "Kirche"],
    ["4959323", "Marktplatz 1", "Marktplatz 1"],
    ["school", "Building", "Town hall"],
  ] as const) {
    await page.fill("#query", text);
    await page.waitForFunction((label) => document.querySelector("#results li")?.textContent === label, result);
    await page.keyboard.press("Enter");
    await page.waitForSelector(".map3d-marker");
    expect(await page.locator(".map3d-marker").textContent()).toBe(pin);
    expect(await page.locator("#info h2").textContent()).toBe(pin);
    expect(await page.inputValue("#query")).toBe(result);
    await page.locator("#info .close").click();
  }
  await page.goto(`${bed.server.origin}/?rendering=${bed.url("unnamed")}`);
  await resting(page);
  await page.locator("#list-in-view").focus();
  await page.keyboard.press("Enter");
  await page.waitForSelector("#in-view li");
  expect((await page.locator("#in-view button").allTextContents()).sort()).toEqual(["Kirche", "Marktplatz 1", "Town hall"]);
  expect(problems).toEqual([]);
});

/** Left, top, right and bottom of what the header and the card leave free, and the point that a marker stands on, once it rests. */
const landing = (page: Page): Promise<{ free: readonly [number, number, number, number]; at: readonly [number, number] }> =>
  page.evaluate(async () => {
    const tip = (): readonly [number, number] => {
      const { left, right, bottom } = (document.querySelector(".map3d-marker") as Element).getBoundingClientRect();
      return [(left + right) / 2, bottom];
    };
    for (let last = "", rests = 0; rests < 10; rests = last === String(tip()) ? rests + 1 : 0) {
      last = String(tip());
      await new Promise(requestAnimationFrame);
    }
    const card = (document.querySelector("#info") as Element).getBoundingClientRect();
    return { free: card.left > 0 ? [0, 0, card.left, innerHeight] : [0, 0, innerWidth, card.top], at: tip() };
  });

test.each([
  ["desk", DESK],
  ["phone", PHONE],
] as const)("%s: every pick of a search ends at what it found, beside its card", async (_name, options) => {
  const { page, problems } = await open(options, bed.url("unnamed"));
  for (const text of ["église", "4959323", "school", "4959323", "église"]) {
    await page.fill("#query", text);
    await page.waitForSelector("#results li");
    await page.keyboard.press("Enter");
    await page.waitForSelector("#info:not([hidden])");
    const { free, at } = await landing(page);
    expect(
      [Math.abs(at[0] / (free[0] + free[2]) - 0.5), Math.abs(at[1] / (free[1] + free[3]) - 0.5)].map((off) => off < 0.1),
      `${text}: ${String(at)} in ${String(free)}`,
    ).toEqual([true, true]);
  }
  expect(problems).toEqual([]);
});

test("a gesture ends the flight to what a search found", async () => {
  const { page } = await open(DESK, bed.url("unnamed"));
  await page.route(/\/objects\/\d+\.json/, async (route) => {
    await page.mouse.move(300, 600);
    await page.mouse.down();
    await page.mouse.move(340, 600);
    await page.mouse.up();
    await route.continue();
  });
  await page.fill("#query", "school");
  await page.waitForSelector("#results li");
  const before = await page.evaluate(() => location.hash);
  await page.keyboard.press("Enter");
  await page.waitForSelector("#info:not([hidden])");
  const { free, at } = await landing(page);
  expect(Math.hypot(at[0] - free[2] / 2, at[1] - free[3] / 2), before).toBeGreaterThan(30);
});

test("a rendering of another origin is shown only with the user's consent", async () => {
  const other = bed.url("town").replace("127.0.0.1", "other.test");
  for (const consents of [true, false]) {
    for (const query of [
      `rendering=${other}`,
      `rendering=${bed.url("town")}&rendering=${other}`,
      `rendering=${bed.url("town")}&with=${other}`,
    ]) {
      const { page } = await bed.openPage(DESK);
      await page.route("http://other.test:*/**", async (route) => {
        await route.fulfill({ response: await route.fetch({ url: route.request().url().replace("other.test", "127.0.0.1") }) });
      });
      const asked: string[] = [],
        fetched: string[] = [];
      page.on("request", (request) => {
        if (new URL(request.url()).hostname === "other.test") fetched.push(request.url());
      });
      page.on("dialog", (dialog) => {
        asked.push(dialog.message());
        void (consents ? dialog.accept() : dialog.dismiss());
      });
      await page.goto(`${bed.server.origin}/?${query}`);
      await page.waitForFunction(
        (isShown) => (isShown ? location.hash.length > 5 : document.querySelector(".failed") !== null),
        consents || query.includes("with="),
      );
      await page.waitForLoadState("networkidle");
      expect(asked).toEqual([`Show the map at ${other}?`]);
      expect(fetched.length > 0).toBe(consents);
      await page.unrouteAll({ behavior: "ignoreErrors" }); // tiles may still be on their way
      await page.context().close();
    }
  }
});

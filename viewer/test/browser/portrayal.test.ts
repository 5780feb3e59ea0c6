import { expect, test } from "vitest";
import type { BrowserContextOptions, Page } from "playwright-core";
import type * as Portrayal from "../../src/portrayal";
import { NOON, withBakedLight } from "../fixture/baked";
import { renderTown } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { pixels, type Global } from "./page";

const town = renderTown(128, 0.38);
const bed = new TestBed({ town });
const undrawn = new TestBed(bed.server, { draws: false });
const litBed = new TestBed({ town: withBakedLight(town) });
type Showing = Global & { map3d: typeof Portrayal };

/** Opens a map with a layer of the service, and waits until it rests. */
async function start(
  options: Record<string, unknown>,
  mapOptions: object = {},
  context: BrowserContextOptions = {},
  from = bed,
): Promise<{ page: Page; problems: string[] }> {
  const opened = await from.bare(context);
  await opened.page.addScriptTag({ url: "/map3d-portrayal.js" });
  await opened.page.evaluate(
    async ([service, given, forMap]) => {
      const g = globalThis as unknown as Showing;
      const { Map3D: Map, ImageLayer: Layer } = (globalThis as unknown as Global).map3d;
      g.map = new Map("mapcanvas", { preserveDrawingBuffer: true, language: "en", ...forMap });
      g.layer = new Layer(g.map3d.portrayalSource(service, given)).addTo(g.map);
      await new Promise<void>((done) => {
        g.map.once("idle", () => {
          done();
        });
      });
    },
    [`${from.server.origin}/3dps`, options, mapOptions] as const,
  );
  return opened;
}

test.each(["webgl", "canvas"] as const)("the layer of a service equals that of the tiles (%s)", async (drawer) => {
  const { page: direct } = await bed.start("town", { language: "en", drawer, preserveDrawingBuffer: true });
  const wanted = await pixels(direct);
  await direct.context().close();
  bed.server.requests.length = 0;
  const { page, problems } = await start({}, { drawer });
  expect((await pixels(page)).equals(wanted)).toBe(true);
  const views = bed.server.requests.filter((url) => url.includes("GetView"));
  // The first requests of a view start together.
  expect(views[0]).toContain("IMAGELAYERS=COLOR,NORMAL");
  expect(bed.server.requests.filter((url) => url.startsWith("/tiles/"))).toEqual([]);
  expect(problems).toEqual([]);
});

test.each(["webgl", "canvas"] as const)("shadows and occlusion of a service equal those of the tiles (%s)", async (drawer) => {
  const light = { azimuth_deg: NOON.azimuth_deg, elevation_deg: NOON.elevation_deg, ambient: 0.3, diffuse: 0.6 };
  const seen = new Map<string, Buffer>();
  const { page: direct } = await litBed.start("town", { language: "en", drawer, light, preserveDrawingBuffer: true });
  seen.set("tiles", await pixels(direct));
  await direct.context().close();
  const sun = { azimuth_deg: NOON.azimuth_deg, elevation_deg: NOON.elevation_deg };
  for (const [name, options] of Object.entries({ both: { sun, occlusion: true }, shadows: { sun }, neither: {} })) {
    litBed.server.requests.length = 0;
    const { page, problems } = await start(options, { drawer, light }, {}, litBed);
    seen.set(name, await pixels(page));
    expect(problems).toEqual([]);
    const asked = litBed.server.requests.filter((url) => url.includes("GetView")).join(" ");
    expect([asked.includes("SUN"), asked.includes("&sun=200,50"), asked.includes("AO")]).toEqual([
      name !== "neither",
      name !== "neither",
      name === "both",
    ]);
    if (name === "both") await page.screenshot({ path: `${OUT}/portrayal-light-${drawer}.png` });
    await page.context().close();
  }
  expect(seen.get("both")?.equals(seen.get("tiles") as Buffer)).toBe(true);
  expect(new Set([...seen.values()].map((bytes) => bytes.toString("base64"))).size).toBe(3);
});

test("on a phone, with one request for each image", async () => {
  bed.server.requests.length = 0;
  const { page, problems } = await start(
    { multipart: false },
    { language: "de" },
    { viewport: { width: 390, height: 844 }, deviceScaleFactor: 3, isMobile: true, hasTouch: true },
  );
  expect(bed.server.requests.some((url) => url.includes("IMAGELAYERS=COLOR;"))).toBe(true);
  expect(bed.server.requests.filter((url) => /IMAGELAYERS=\w+,/.test(url))).toEqual([]);
  await page.screenshot({ path: `${OUT}/portrayal-phone.png` });
  expect(problems).toEqual([]);
});

test.each<[string, Record<string, unknown>, string]>([
  ["an unknown layer", { layers: "village" }, 'has no layer "village"; it has town'],
  ["another system", { crs: "EPSG:2056" }, "the layer is not available in EPSG:2056; it has EPSG:25832"],
  ["an unknown rendering", { rendering: "x" }, 'the layer links to no rendering "x"; it links to town'],
  ["a format that the service lacks", { colorFormat: "image/webp" }, "the service has no COLOR images as image/webp; it has image/png"],
  ["occlusion that the service lacks", { occlusion: true }, "does not advertise the image layer AO; it has DEPTH, OBJECTID, NORMAL, COLOR"],
  ["shadows that the service lacks", { sun: { azimuth_deg: 200, elevation_deg: 50 } }, "does not advertise the image layer SUN"],
  ["too many styles", { styles: ["a", "b"] }, "styles: expected one per layer, got 2 for 1"],
  ["an invalid view", { views: ["400-45"] }, 'view "400-45": expected a look-at angle'],
])("the map names the error: %s", async (_, options, words) => {
  const { page } = await undrawn.bare();
  await page.addScriptTag({ url: "/map3d-portrayal.js" });
  const message = await page.evaluate(
    async ([service, given]) => {
      const g = globalThis as unknown as Showing;
      const { Map3D: Map, ImageLayer: Layer } = (globalThis as unknown as Global).map3d;
      const shown = new Map("mapcanvas");
      return new Promise<string>((done) => {
        shown.on("error", ({ error }) => {
          done(`${error.name}: ${error.message}`);
        });
        new Layer(g.map3d.portrayalSource(service, given)).addTo(shown);
      });
    },
    [`${bed.server.origin}/3dps`, options] as const,
  );
  expect(message).toContain("UsageError: ");
  expect(message).toContain(words);
});

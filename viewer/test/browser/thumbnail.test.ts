import { beforeAll, expect, test } from "vitest";
import type { Page } from "playwright-core";
import { renderTown, type Fixture } from "../fixture/rendering";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { steady } from "./page";

const TILE_PX = 128;
const town = renderTown(TILE_PX);
const bed = new TestBed({
  town,
  broken: withThumbnails(town, [{ window: [0, 0, 1], webp: "AAAA" }, null, "AAAA", { window: [0, 0, 9, 9], webp: "AAAA);color:red" }]),
});
const undrawn = new TestBed(bed.server, { draws: false });
const WINDOW = [14, 20, 100, 92] as const;
const element = (
  name: string,
  more = "",
): string => `<!doctype html><html lang="en"><head><meta charset="utf-8"><title>test</title><link rel="icon" href="data:,"><link rel="stylesheet" href="/element.css"></head>
<body><map-3d src="tiles/${name}" controls="off" attribution="off" ${more}></map-3d><script src="/map3d.js"></script><script src="/map3d-element.js"></script></body></html>`;
bed.server.pages.set("/element.css", "body { margin: 0; } map-3d { height: 100vh; }");
bed.server.pages.set("/element", element("town"));
bed.server.pages.set("/canvas", element("town", 'drawer="canvas"'));
bed.server.pages.set("/night", element("town", 'time="2026-06-21T23:00Z"'));
bed.server.pages.set("/depth", element("town", 'mode="depth"'));
bed.server.pages.set("/broken", element("broken"));
const PAGE = "/?rendering=/tiles/town";

function withThumbnails(fixture: Fixture, thumbnails: readonly unknown[]): Fixture {
  return {
    ...fixture,
    json: { ...fixture.json, views: fixture.json.views.map((view, k) => ({ ...view, thumbnail: thumbnails[k] as null })) },
  };
}

/** Cuts the thumbnail of a view out of its tile of level 0. */
async function makeThumbnail(page: Page, view: string): Promise<{ window: number[]; webp: string }> {
  const raw = Buffer.from(town.raw.get(`${view}/color/0/0/0`) ?? []).toString("base64");
  const url = await page.evaluate(
    ([text, side, [x, y, width, height]]) => {
      const tile = new ImageData(
        Uint8ClampedArray.from(atob(text), (byte) => byte.charCodeAt(0)),
        side,
      );
      const canvas = Object.assign(document.createElement("canvas"), { width, height });
      canvas.getContext("2d")?.putImageData(tile, -x, -y);
      return canvas.toDataURL("image/webp", 1);
    },
    [raw, TILE_PX, WINDOW] as const,
  );
  return { window: [...WINDOW], webp: url.replace("data:image/webp;base64,", "") };
}

beforeAll(async () => {
  const { page } = await bed.bare();
  const thumbnails = [];
  for (const { id } of town.json.views) thumbnails.push(await makeThumbnail(page, id));
  bed.server.renderings.set("town", withThumbnails(town, thumbnails));
});

/** Records the thumbnails that any frame shows. A property that depends on another can be read as a whole only. */
function record(): void {
  const seen: string[] = [];
  Object.assign(globalThis, { seen });
  const look = (): void => {
    const shown = document.querySelector<HTMLElement>(".map3d")?.style.background ?? "";
    if (shown.includes("url")) seen.push(shown);
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}

type Recorded = typeof globalThis & { seen: string[] };
const backgroundOf = (page: Page): Promise<string> =>
  page.evaluate(() => getComputedStyle(document.querySelector(".map3d") ?? document.body).backgroundImage);
/** Place and size of the thumbnail. */
const placeOf = (page: Page): Promise<string> =>
  page.evaluate(() => {
    const { backgroundPosition, backgroundSize } = getComputedStyle(document.querySelector(".map3d") ?? document.body);
    return `${backgroundPosition} ${backgroundSize}`;
  });
const numberSeen = (page: Page): Promise<number> => page.evaluate(() => (globalThis as Recorded).seen.length);

/** Opens a page while no tiles of a kind arrive. High contrast, where the page has no haze. */
async function openHeld(path: string, kind = "color", from = undrawn): Promise<{ page: Page; problems: string[]; release: () => void }> {
  const release = bed.server.hold(`/${kind}/`);
  const opened = await from.openPage({ viewport: { width: 640, height: 480 }, contrast: "more", reducedMotion: "reduce" });
  await opened.page.addInitScript(record);
  await opened.page.goto(`${bed.server.origin}${path}`);
  await expect.poll(() => bed.server.requests.some((url) => url.includes(`/${kind}/`))).toBe(true);
  return { ...opened, release };
}

/** Takes a picture of the map alone. */
async function shoot(page: Page, name: string): Promise<string> {
  await page.evaluate(() => {
    for (const over of document.querySelectorAll<HTMLElement>(".card, .loading, .skip, .map3d-controls")) over.style.visibility = "hidden";
  });
  return (await page.screenshot({ path: `${OUT}/thumbnail-${name}.png` })).toString("base64");
}

/** Returns by how much the edges in two pictures differ, for each shift of the second one. Edges tell places, whatever the light. */
function compare(page: Page, first: string, second: string, shifts: readonly (readonly [number, number])[]): Promise<number[]> {
  return page.evaluate(
    async ([one, other, all]) => {
      const [a, b] = (await Promise.all(
        [one, other].map(async (text) => {
          const bitmap = await createImageBitmap(new Blob([Uint8Array.from(atob(text), (byte) => byte.charCodeAt(0))]));
          const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d") as OffscreenCanvasRenderingContext2D;
          context.drawImage(bitmap, 0, 0);
          return context.getImageData(0, 0, bitmap.width, bitmap.height);
        }),
      )) as [ImageData, ImageData];
      const [margin, reach] = [16, 8];
      const step = ({ data, width }: ImageData, x: number, y: number, dx: number, dy: number): number =>
        (data[4 * ((y + dy) * width + x + dx)] ?? 0) - (data[4 * ((y - dy) * width + x - dx)] ?? 0);
      return all.map(([dx, dy]) => {
        let sum = 0;
        for (let y = margin; y < a.height - margin; y++)
          for (let x = margin; x < a.width - margin; x++)
            for (const [across, down] of [
              [reach, 0],
              [0, reach],
            ] as const)
              sum += Math.abs(step(a, x, y, across, down) - step(b, x + dx, y + dy, across, down));
        return sum / (a.width * a.height);
      });
    },
    [first, second, shifts] as const,
  );
}

const SHIFTS = [
  [0, 0],
  [6, 0],
  [-6, 0],
  [0, 6],
  [0, -6],
] as const;

test.each([
  ["page", PAGE],
  ["element", "/element"],
  ["canvas", "/canvas"],
])("%s: the thumbnail stands where the tiles then appear, moves with the map, and goes", async (name, path) => {
  const { page, problems, release } = await openHeld(path, "color", bed);
  try {
    await expect.poll(() => backgroundOf(page)).toContain("data:image/webp");
    const first = await shoot(page, `${name}-first`);
    await page.mouse.move(320, 240);
    await page.mouse.wheel(0, -240);
    await steady(page, () => placeOf(page));
    await page.mouse.down();
    await page.mouse.move(290, 265, { steps: 5 });
    await page.mouse.up();
    await steady(page, () => placeOf(page));
    const moved = await shoot(page, `${name}-moved`);
    expect(await backgroundOf(page)).toContain("data:image/webp");
    release();
    await expect.poll(() => backgroundOf(page), { timeout: 20_000 }).toBe("none");
    await page.waitForLoadState("networkidle");
    await steady(page, () => page.screenshot());
    const tiles = await shoot(page, `${name}-tiles`);
    const [exact = NaN, ...shifted] = await compare(page, moved, tiles, SHIFTS);
    for (const difference of shifted) expect(difference).toBeGreaterThan(exact);
    const [unmoved = NaN] = await compare(page, first, tiles, SHIFTS);
    expect(unmoved).toBeGreaterThan(exact);
    expect(problems).toEqual([]);
  } finally {
    release();
  }
});

test.each([
  ["a link with a time at night", `${PAGE}#0-45/691000.0/5336000.0/500.0/1.00/t=2026-06-21T23:00Z`, "color"],
  ["an element with a time at night", "/night", "color"],
  ["an element with the mode depth", "/depth", "depth"],
  ["a malformed thumbnail on the page", "/?rendering=/tiles/broken", "color"],
  ["a malformed thumbnail in an element", "/broken", "color"],
])("%s shows none at any time, without an error", async (_, path, kind) => {
  const { page, problems, release } = await openHeld(path, kind);
  await page.waitForTimeout(500);
  release();
  await page.waitForFunction(() => document.querySelectorAll(".map3d canvas").length > 0);
  await page.waitForLoadState("networkidle");
  expect(await numberSeen(page)).toBe(0);
  expect(problems).toEqual([]);
});

test("frames before the first tile show it, and an element that is removed leaves nothing", async () => {
  const { page, problems, release } = await openHeld("/element");
  await expect.poll(() => numberSeen(page)).toBeGreaterThan(0);
  await page.evaluate(() => {
    document.querySelector("map-3d")?.remove();
  });
  await page.waitForTimeout(200);
  expect(await page.locator(".map3d").count()).toBe(0);
  release();
  await page.waitForTimeout(300);
  expect(problems).toEqual([]);
});

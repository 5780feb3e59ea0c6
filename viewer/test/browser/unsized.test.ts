import { expect, test } from "vitest";
import { renderTown } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import type { Global } from "./page";

const bed = new TestBed({ town: renderTown() }, { draws: false });
type View = Parameters<Global["map"]["setView"]>;
type Shown = readonly [u: number, v: number, zoom: number];

/** What a map shows that was created in a hidden element, after that has got its size. @param view is set while it is hidden and ready */
async function show(hidden: boolean, options: object, view?: View): Promise<{ shown: Shown; errors: string[] }> {
  const { page, problems } = await bed.bare();
  const shown = await page.evaluate(
    async ([url, given, isHidden, view]) => {
      const g = globalThis as Global;
      const tab = document.createElement("div");
      Object.assign(tab.style, { width: "700px", height: isHidden ? "0" : "500px" });
      document.body.replaceChildren(tab);
      const map = (g.map = new g.map3d.map(tab, given));
      new g.map3d.imageLayer(url).addTo(map);
      await new Promise<void>((ready) => {
        map.whenReady(() => {
          ready();
        });
      });
      if (view) map.setView(...view);
      const idle = new Promise((done) => map.once("idle", done));
      if (isHidden) await new Promise((done) => setTimeout(done, 50));
      tab.style.height = "500px";
      await idle;
      await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
      const { camera } = map.getViewState() as unknown as { camera: { u: number; v: number; zoom: number } };
      return [camera.u, camera.v, camera.zoom] as const;
    },
    [bed.url("town"), options, hidden, view] as const,
  );
  if (hidden) await page.screenshot({ path: `${OUT}/unsized.png` });
  await page.context().close();
  return { shown, errors: problems };
}

test.each([
  ["the first picture", {}],
  ["a first picture that fills the screen", { cover: true }],
  ["a centre without a zoom", { center: [ORIGIN[0] + 20, ORIGIN[1] + 10, ORIGIN[2]] }],
  ["a centre on the ground without a zoom", { center: { xy: [ORIGIN[0] + 20, ORIGIN[1] + 10], height: ORIGIN[2] } }],
  ["a zoom without a centre", { zoom: 2.5 }],
  [
    "bounds",
    {
      maxBounds: [
        [ORIGIN[0] + 10, ORIGIN[1] + 10, ORIGIN[2]],
        [ORIGIN[0] + 20, ORIGIN[1] + 20, ORIGIN[2]],
      ],
    },
  ],
] as const)("%s of a map without height is the same as that of a map with a size, once its element has one", async (_, options) => {
  const [late, early] = [await show(true, options), await show(false, options)];
  late.shown.forEach((value, k) => {
    expect(value).toBeCloseTo(early.shown[k] ?? NaN, 6);
  });
  expect([...late.errors, ...early.errors]).toEqual([]);
});

test("what the page has set before is kept: a zoom with its position, or a position with the fitting zoom", async () => {
  const fitted = (await show(false, {})).shown;
  const zoomed = (await show(true, {}, [[691000, 5336010, 500], 3])).shown;
  const same = (await show(false, {}, [[691000, 5336010, 500], 3])).shown;
  zoomed.forEach((value, k) => {
    expect(value).toBeCloseTo(same[k] ?? NaN, 6);
  });
  expect(zoomed[2]).toBe(3);
  const moved = (await show(true, {}, [[691000, 5336010, 500]])).shown;
  expect(moved[0]).toBeCloseTo(same[0], 6);
  expect(moved[2]).toBeCloseTo(fitted[2], 6);
});

import { expect, test } from "vitest";
import { devices, type CDPSession, type Page } from "playwright-core";
import { renderTown } from "../fixture/rendering";
import { ORIGIN } from "../fixture/town";
import { TestBed } from "./testBed";
import { OUT } from "./browser";
import { BARE, drawn, picture, type Global } from "./page";

const bed = new TestBed({ town: renderTown() });
bed.server.pages.set("/phone", BARE.replace("<title>", '<meta name="viewport" content="width=device-width, initial-scale=1"><title>'));
const PHONE = {
  viewport: { width: 390, height: 844 },
  deviceScaleFactor: 3,
  isMobile: true,
  hasTouch: true,
  userAgent: devices["iPhone 14"].userAgent,
};
/** CPU slowdown. */
const SLOW = 4;
type Point = readonly [x: number, y: number];
type World = [number, number, number];
const GROUND: World = [ORIGIN[0] + 10, ORIGIN[1] + 4, ORIGIN[2]];
const ROOF: World = [ORIGIN[0] - 45, ORIGIN[1] - 4, ORIGIN[2] + 34];

/** Fingers on the screen. */
class TouchInput {
  /** Time of the last event, s. */
  #now = Date.now() / 1000;

  constructor(
    private readonly page: Page,
    private readonly session: CDPSession,
  ) {}

  /** Puts fingers down, moves them by steps at the frame rate of a fast screen, and lifts them, however long the page takes. */
  async move(steps: readonly (readonly Point[])[]): Promise<void> {
    const sent: Promise<unknown>[] = [];
    const start = (this.#now = Math.max(this.#now + 0.05, Date.now() / 1000));
    for (const [k, fingers] of [...steps, []].entries()) {
      const type = k === 0 ? "touchStart" : k === steps.length ? "touchEnd" : "touchMove";
      sent.push(
        this.session.send("Input.dispatchTouchEvent", {
          type,
          touchPoints: fingers.map(([x, y], id) => ({ x, y, id })),
          timestamp: (this.#now = start + 0.016 * k),
        }),
      );
      await this.page.waitForTimeout(16);
    }
    await Promise.all(sent);
  }

  async tap(at: Point): Promise<void> {
    await this.move([[at]]);
  }

  /** Taps twice, a twentieth of a second apart by the events' times, however long the page takes. */
  async doubleTap(at: Point): Promise<void> {
    const first = (this.#now = Math.max(this.#now + 0.05, Date.now() / 1000));
    for (const [k, type] of (["touchStart", "touchEnd", "touchStart", "touchEnd"] as const).entries()) {
      await this.session.send("Input.dispatchTouchEvent", {
        type,
        touchPoints: type === "touchStart" ? [{ x: at[0], y: at[1], id: 0 }] : [],
        timestamp: (this.#now = first + 0.05 * k),
      });
    }
  }
}

const steps = (count: number, at: (part: number) => readonly Point[]): (readonly Point[])[] =>
  Array.from({ length: count + 1 }, (_, k) => at(k / count));
const placeOf = (page: Page, world: World): Promise<Point> => page.evaluate((at) => (globalThis as Global).map.project(at) as Point, world);
const zoomOf = (page: Page): Promise<number> => page.evaluate(() => (globalThis as Global).map.zoom);
test.each(["webgl", "canvas"])(
  "%s: on a slow phone the map opens; fingers drag, fling, pinch, rotate, tap and double-tap",
  async (drawer) => {
    const { page, problems } = await bed.openPage(PHONE);
    await page.goto(`${bed.server.origin}/phone`);
    const session = await page.context().newCDPSession(page);
    await session.send("Emulation.setCPUThrottlingRate", { rate: SLOW });
    await page.evaluate(
      ([url, drawn]) =>
        new Promise<void>((done) => {
          const g = globalThis as Global;
          g.clicks = [];
          g.map = new g.map3d.map("mapcanvas", { zoom: 2.4, drawer: drawn as "webgl", preserveDrawingBuffer: true });
          g.layer = new g.map3d.imageLayer(url).addTo(g.map);
          g.map
            .on("click", (event) => g.clicks.push(event))
            .once("idle", () => {
              done();
            });
        }),
      [bed.url("town"), drawer] as const,
    );
    const touch = new TouchInput(page, session);
    expect(
      await page.evaluate(() => [
        (globalThis as Global).map.drawer,
        (globalThis as Global).map.canvas.width,
        (globalThis as Global).map.canvas.height,
      ]),
    ).toEqual([drawer, 780, 1688]);
    const shown = await picture(page);
    expect(shown.filter((value, k) => k % 4 === 3 && value === 255).length / (780 * 1688)).toBeGreaterThan(0.15);
    await page.screenshot({ path: `${OUT}/phone-${drawer}.png` });

    // A drag that rests before the finger is lifted: the ground stays under it.
    const from = await placeOf(page, GROUND);
    const still = Array.from({ length: 9 }, () => [[from[0] + 60, from[1] - 80]] as const);
    await touch.move([...steps(8, (part) => [[from[0] + 60 * part, from[1] - 80 * part]]), ...still]);
    const dragged = await placeOf(page, GROUND);
    expect(Math.hypot(dragged[0] - from[0] - 60, dragged[1] - from[1] + 80)).toBeLessThan(1.5);

    // A finger lifted in motion: inertia, then rest.
    await touch.move(steps(8, (part) => [[300 - 120 * part, 400]]));
    const lifted = await placeOf(page, GROUND);
    await drawn(page);
    const flung = await placeOf(page, GROUND);
    expect(lifted[0] - dragged[0]).toBeLessThan(-100);
    expect(flung[0] - dragged[0]).toBeLessThan(-135);
    expect(Math.abs(flung[1] - dragged[1])).toBeLessThan(2);

    // Two fingers spread to twice the distance: one level in, about the point between them.
    await page.evaluate((at) => (globalThis as Global).map.setView(at, 2.4), GROUND);
    await drawn(page);
    const [before, between] = [await zoomOf(page), await page.evaluate(() => (globalThis as Global).map.unproject([200, 420]) as World)];
    await touch.move(
      steps(10, (part) => [
        [200 - 50 * (1 + part), 420],
        [200 + 50 * (1 + part), 420],
      ]),
    );
    expect(await zoomOf(page)).toBeCloseTo(before + 1, 1);
    await drawn(page);
    const stayed = await placeOf(page, between);
    expect(Math.hypot(stayed[0] - 200, stayed[1] - 420)).toBeLessThan(3);

    // Two fingers rotate by 40 degrees: the next direction, and back.
    const turn = (sign: number): Promise<void> =>
      touch.move(
        steps(10, (part) => {
          const [dx, dy] = [80 * Math.cos(sign * part * 0.7), 80 * Math.sin(sign * part * 0.7)];
          return [
            [200 - dx, 420 - dy],
            [200 + dx, 420 + dy],
          ];
        }),
      );
    const direction = (): Promise<string> => page.evaluate(() => (globalThis as Global).map.direction);
    await turn(1);
    await expect.poll(direction, { timeout: 20_000 }).toMatch(/^(90|270)-45$/);
    await drawn(page);
    await turn(-1);
    await expect.poll(direction, { timeout: 20_000 }).toBe("0-45");
    expect(await zoomOf(page)).toBeCloseTo(before + 1, 1);

    // A tap picks; a double tap zooms in there and does not pick a second time.
    await page.evaluate((at) => (globalThis as Global).map.setView(at, 2), ROOF);
    await drawn(page);
    const roof = await placeOf(page, ROOF);
    await touch.tap(roof);
    await page.waitForFunction(() => (globalThis as Global).clicks.length > 0);
    const click = await page.evaluate(() =>
      (({ id, position }) => ({ id, position }))((globalThis as Global).clicks[0] as Global["clicks"][0]),
    );
    expect(click.id).toBe(17);
    expect(click.position?.[2]).toBeCloseTo(ROOF[2], 2);
    await page.waitForTimeout(400); // more than between the taps of a double tap
    await touch.doubleTap(roof);
    await page.waitForFunction(() => (globalThis as Global).map.zoom > 2.95);
    await drawn(page);
    const zoomed = await placeOf(page, ROOF);
    expect(Math.hypot(zoomed[0] - roof[0], zoomed[1] - roof[1])).toBeLessThan(2);
    await page.screenshot({ path: `${OUT}/phone-${drawer}-end.png` });
    expect(problems).toEqual([]);
  },
);

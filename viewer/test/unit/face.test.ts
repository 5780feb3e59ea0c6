import { describe, expect, test } from "vitest";
import type { Box3, Vec2, Vec3 } from "../../src/core/vec";
import { add } from "../../src/core/vec";
import { uvdFromLocal } from "../../src/geo/axes";
import type { Frame } from "../../src/geo/frame";
import { pixelM } from "../../src/geo/frame";
import type { Map3D } from "../../src/map3d";
import { measureArea } from "../../src/measure/geometry";
import { measureFace, type Face } from "../../src/measure/face";
import { loopsOf } from "../../src/measure/outline";
import { BOX, framesOf, ORIGIN, THINGS, trace } from "../fixture/town";

const PX = 0.2;

interface Spot {
  readonly area_m2: number;
  readonly slope_deg: number;
  /** Local, by shares of its sides. */
  at(s: number, t: number): Vec3;
}

/** The sides of a box that are visible from some direction. */
function facesOf([lo, hi]: Box3): Spot[] {
  const [w, l, h] = [hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]];
  const wall = (x0: number, y0: number, x1: number, y1: number, area_m2: number): Spot => ({
    area_m2,
    slope_deg: 90,
    at: (s, t) => [x0 + (x1 - x0) * s, y0 + (y1 - y0) * s, lo[2] + h * t],
  });
  return [
    { area_m2: w * l, slope_deg: 0, at: (s, t) => [lo[0] + w * s, lo[1] + l * t, hi[2]] },
    wall(lo[0], lo[1], hi[0], lo[1], w * h),
    wall(lo[0], hi[1], hi[0], hi[1], w * h),
    wall(lo[0], lo[1], lo[0], hi[1], l * h),
    wall(hi[0], lo[1], hi[0], hi[1], l * h),
  ];
}

function frameAt(lookAt: number, pitch: number, tilePx = 256, px = PX): Frame {
  return framesOf(BOX, tilePx, px, [[lookAt, pitch]]).frames[0] as Frame;
}

/** Finds what rays hit. */
type Surface = (u: number, v: number) => { readonly id: number; readonly d: number } | null;

const town =
  (frame: Frame): Surface =>
  (u, v) => {
    const hit = trace(frame, u, v);
    return hit && { id: hit.id, d: frame.d0 + Math.round(hit.d * 1024) / 1024 };
  };

/** A map that shows a surface, pixel by pixel; `asked`: the number of tiles requested from it. */
function mapOf(frame: Frame, surface: Surface = town(frame), asked: number[] = []): Map3D {
  return {
    getViewState: () => ({ camera: { frame }, origin: ORIGIN }),
    fetchDepths: (_: unknown, [low, high]: readonly [Vec2, Vec2], most: number) => {
      let z = frame.zmax;
      const tiles = (): number => (((high[0] - low[0]) * 2 ** z) / frame.size + 1) * (((high[1] - low[1]) * 2 ** z) / frame.size + 1);
      while (z > 0 && tiles() > most) z--;
      asked.push(tiles());
      const px = pixelM(frame, z);
      const at = (u: number, v: number): ReturnType<Surface> =>
        surface(frame.u0 + (Math.floor((u - frame.u0) / px) + 0.5) * px, frame.v0 - (Math.floor((frame.v0 - v) / px) + 0.5) * px);
      const relief = {
        pixel_m: px,
        idAt: (u: number, v: number) => at(u, v)?.id ?? 0,
        depthAt: (u: number, v: number) => at(u, v)?.d ?? Infinity,
      };
      return Promise.resolve({ relief, approximate: z < frame.zmax });
    },
  } as unknown as Map3D;
}

/** Returns the positions on a face that rays reach. */
function seenOf(frame: Frame, spot: Spot): Vec3[] {
  const shares = Array.from({ length: 30 }, (_, k) => (k + 0.5) / 30);
  return shares
    .flatMap((s) => shares.map((t) => spot.at(s, t)))
    .filter((local) => {
      const [u, v, d] = uvdFromLocal(frame.axes, local);
      return Math.abs(frame.d0 + (trace(frame, u, v)?.d ?? Infinity) - d) < 0.01;
    });
}

const areaOf = (outline: Face["outline"]): number => outline.reduce((sum, loop) => sum + measureArea(loop).area_m2, 0);

describe("faces of the town, by rays of every pixel", () => {
  test.each([
    [0, 45],
    [30, 45],
    [45, 22.5],
    [180, 60],
    [120, 30],
    [90, 90],
  ])("looking %d° at %d°: walls and roofs have the areas of the model, and hidden parts are reported", async (lookAt, pitch) => {
    const frame = frameAt(lookAt, pitch);
    const counts = { whole: 0, hidden: 0 };
    for (const spot of THINGS.slice(1).flatMap(({ box }) => facesOf(box))) {
      const seen = seenOf(frame, spot);
      const share = seen.length / 900;
      const middle = seen[Math.floor(seen.length / 2)];
      if (!middle || share < 0.1) continue;
      const face = await measureFace(mapOf(frame), add(ORIGIN, middle));
      if (!face) throw new Error("no face");
      expect(face.approximate).toBe(false);
      expect(Math.abs(face.slope_deg - spot.slope_deg)).toBeLessThan(0.2);
      if (share === 1) {
        counts.whole++;
        expect(Math.abs(face.area_m2 / spot.area_m2 - 1)).toBeLessThan(0.02);
        expect(face.hidden).toBe(false);
        expect(face.outline.length).toBe(1);
        expect(Math.abs(areaOf(face.outline) / spot.area_m2 - 1)).toBeLessThan(0.04);
        expect(face.outline[0]?.length).toBeLessThan(12);
      } else if (share < 0.9) {
        counts.hidden++;
        expect(face.hidden).toBe(true);
        expect(face.area_m2).toBeLessThan(spot.area_m2 * (share + 0.05));
      }
    }
    expect(counts.whole).toBeGreaterThan(3);
  });

  test("the outline is on the face, the normal points towards the viewer", async () => {
    const frame = frameAt(30, 45);
    const face = await measureFace(mapOf(frame), add(ORIGIN, [32, 26, 62]));
    for (const [x, y, z] of face?.outline.flat() ?? []) {
      expect(Math.abs(z - ORIGIN[2] - 62)).toBeLessThan(0.01);
      expect(x - ORIGIN[0]).toBeGreaterThan(24 - 2 * PX);
      expect(x - ORIGIN[0]).toBeLessThan(40 + 2 * PX);
      expect(y - ORIGIN[1]).toBeGreaterThan(18 - 2 * PX);
      expect(y - ORIGIN[1]).toBeLessThan(34 + 2 * PX);
    }
    expect(face?.normal[2]).toBeCloseTo(1, 5);
    const wall = await measureFace(mapOf(frame), add(ORIGIN, [-45, -22, 15]));
    expect(wall?.normal[1]).toBeCloseTo(-1, 5);
  });
});

describe("difficult faces", () => {
  test("a hidden or empty position has no face", async () => {
    const frame = frameAt(0, 45);
    expect(await measureFace(mapOf(frame), add(ORIGIN, [-45, 14, 10]))).toBeNull();
    expect(await measureFace(mapOf(frame), add(ORIGIN, [-150, 0, 0]))).toBeNull();
  });

  test("a roof's face ends at the ridge", async () => {
    // Two slopes of 20 × 8 m as seen from above, 30° steep, their ridge along x at z = 10.
    const frame = frameAt(0, 60);
    const rise = Math.tan(Math.PI / 6);
    const { up, forward } = frame.axes;
    const roof: Surface = (u, v) => {
      for (const sign of [-1, 1]) {
        // Points (u, y, z) with z = 10 − |y|·rise and V = up·(y, z).
        const y = (v - up[2] * 10) / (up[1] - sign * up[2] * rise);
        if (Math.sign(y) === sign && Math.abs(y) <= 8 && Math.abs(u) <= 10)
          return { id: 5, d: forward[1] * y + forward[2] * (10 - Math.abs(y) * rise) };
      }
      return { id: 3, d: (v / up[1]) * forward[1] };
    };
    const face = await measureFace(mapOf(frame, roof), add(ORIGIN, [3, -4, 10 - 4 * rise]));
    const area = (20 * 8) / Math.cos(Math.PI / 6);
    expect(face?.slope_deg).toBeCloseTo(30, 0.5);
    expect(Math.abs((face?.area_m2 ?? 0) / area - 1)).toBeLessThan(0.02);
    expect(face?.hidden).toBe(false);
  });

  test("a wall between a roof and the ground is exact to a fraction of a pixel", async () => {
    // 54 × 16 m: 14.9 rows of pixels.
    const face = await measureFace(mapOf(frameAt(0, 45, 256, 0.76)), add(ORIGIN, [31, -46, 8]));
    expect(Math.abs((face?.area_m2 ?? 0) / (54 * 16) - 1)).toBeLessThan(0.01);
  });

  test("a face that needs too many tiles is read from a level above and marked approximate", async () => {
    // A field of 200 × 160 m, 5 m beneath the origin.
    const asked: number[] = [];
    const frame = frameAt(0, 60, 512, 0.1);
    const { up, forward } = frame.axes;
    const field: Surface = (u, v) => {
      const y = (v + 5 * up[2]) / up[1];
      return Math.abs(u) < 100 && Math.abs(y) < 80 ? { id: 3, d: forward[1] * y - 5 * forward[2] } : null;
    };
    const face = await measureFace(mapOf(frame, field, asked), add(ORIGIN, [1, 2, -5]));
    expect(asked.every((tiles) => tiles <= 9)).toBe(true);
    expect(asked.length).toBeLessThan(10);
    expect(face?.approximate).toBe(true);
    expect(Math.abs((face?.area_m2 ?? 0) / (200 * 160) - 1)).toBeLessThan(0.01);
  });
});

test("loops: holes are separate and reversed, pixels that touch at a corner are separate", () => {
  const loops = (rows: readonly string[]): ReturnType<typeof loopsOf> => {
    const width = (rows[0] ?? "").length + 2;
    return loopsOf(
      Uint8Array.from(["", ...rows, ""].map((row) => `.${row.padEnd(width - 2, ".")}.`).join(""), (sign) => (sign === "#" ? 1 : 0)),
      width,
    );
  };
  const turn = (loop: readonly Vec2[]): number =>
    loop.reduce((sum, [x, y], k) => sum + x * (loop[(k + 1) % loop.length]?.[1] ?? 0) - (loop[(k + 1) % loop.length]?.[0] ?? 0) * y, 0) / 2;
  expect(loops(["####", "####", "####"])).toEqual([
    [
      [1, 1],
      [5, 1],
      [5, 4],
      [1, 4],
    ],
  ]);
  expect(loops(["#######", "#######", "##...##", "##...##", "##...##", "#######", "#######"]).map(turn)).toEqual([49, -9]);
  expect(loops(["##...", "##...", "..###", "..###", "..###"]).map(turn)).toEqual([4, 9]);
  expect(loops(["..##", "..##", "##..", "##.."]).map(turn)).toEqual([4, 4]);
  expect(loops(["...", "..."])).toEqual([]);
});

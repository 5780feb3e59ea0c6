import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { describe, expect, test } from "vitest";
import { computeAxes, depthAtHeight, localFromUvd, uvdFromLocal, viewId } from "../../src/geo/axes";
import { ancestor, blockLevel, blockRoot, childrenOf, makeFrame, morton, pixelAt, uvOfPixel, type FrameJson } from "../../src/geo/frame";
import { Occupancy } from "../../src/geo/occupancy";
import type { Box3, Vec3 } from "../../src/core/vec";
import { pin } from "../fixture/town";
import { encodeOccupancy } from "../fixture/rendering";

const vectors = <T>(name: string): T =>
  JSON.parse(readFileSync(resolve(import.meta.dirname, `../../../spec/vectors/${name}.json`), "utf8")) as T;

interface ViewRow {
  look_at_deg: number;
  pitch_deg: number;
  id: string;
  right: Vec3;
  up: Vec3;
  forward: Vec3;
  points: { local: Vec3; uvd: Vec3 }[];
}

describe("views", () => {
  test.each(vectors<ViewRow[]>("views"))("the axes of view $id and its coordinates of points match the vectors", (row) => {
    const axes = computeAxes(row.look_at_deg, row.pitch_deg);
    expect(viewId(row.look_at_deg, row.pitch_deg)).toBe(row.id);
    for (const name of ["right", "up", "forward"] as const)
      row[name].forEach((part, k) => {
        expect(axes[name][k as 0]).toBeCloseTo(part, 15);
      });
    for (const { local, uvd } of row.points) {
      uvdFromLocal(axes, local).forEach((part, k) => {
        expect(part).toBeCloseTo(uvd[k as 0], 9);
      });
      localFromUvd(axes, uvd).forEach((part, k) => {
        expect(part).toBeCloseTo(local[k as 0], 9);
      });
    }
  });

  test("the point at a given height has that height", () => {
    const axes = computeAxes(37.5, 22.5);
    const d = depthAtHeight(axes, 12.5, 42) ?? NaN;
    expect(localFromUvd(axes, [3, 12.5, d])[2]).toBeCloseTo(42, 9);
    expect(depthAtHeight({ ...axes, forward: [0, 1, 0] }, 0, 0)).toBeNull();
  });
});

interface TilesFile {
  frame: { zmax: number; size_m: number; views: FrameJson[] };
  view: number;
  tile_px: number;
  rows: {
    tile: [number, number, number];
    pixel: [number, number];
    u: number;
    v: number;
    morton: number;
    parent: [number, number, number] | null;
  }[];
}

describe("tiles", () => {
  const file = vectors<TilesFile>("tiles");
  const frame = makeFrame(file.frame.views[file.view] as FrameJson, file.frame.size_m, file.tile_px, file.frame.zmax);

  test.each(file.rows)("tile $tile, pixel $pixel", ({ tile: [z, x, y], pixel: [i, j], u, v, morton: code, parent }) => {
    const tile = { z, x, y };
    const uv = uvOfPixel(frame, tile, i, j);
    expect(uv[0]).toBeCloseTo(u, 9);
    expect(uv[1]).toBeCloseTo(v, 9);
    expect(pixelAt(frame, z, ...uv)).toEqual({ tile, i, j });
    expect(morton(x, y)).toBe(code);
    if (parent) expect(ancestor(tile, 1)).toEqual({ z: parent[0], x: parent[1], y: parent[2] });
  });

  test("a child's parent is the tile itself", () => {
    for (const child of childrenOf({ z: 5, x: 17, y: 30 })) expect(ancestor(child, 1)).toEqual({ z: 5, x: 17, y: 30 });
  });

  test("no pixel is outside the square", () => {
    expect(pixelAt(frame, 2, frame.u0 - 0.01, frame.v0 - 1)).toBeNull();
    expect(pixelAt(frame, 2, frame.u0 + frame.size, frame.v0 - 1)).toBeNull();
    expect(pixelAt(frame, 2, NaN, 0)).toBeNull();
  });

  test("Morton codes are exact at level 26", () => {
    expect(morton(2 ** 26 - 1, 2 ** 26 - 1)).toBe(4 ** 26 - 1);
  });
});

describe("blocks", () => {
  test.each(vectors<{ zmax: number; blocks: [number, number, string][] }[]>("blocks"))(
    "zmax $zmax: each level is in the block of the vectors",
    ({ zmax, blocks }) => {
      for (const [root, levels] of blocks) for (let z = root; z < root + levels; z++) expect(blockLevel(z, zmax)).toBe(root);
    },
  );

  test("a tile's block is its ancestor at the root level", () => {
    expect(blockRoot({ z: 5, x: 21, y: 30 }, 5)).toEqual({ z: 2, x: 2, y: 3 });
    expect(blockRoot({ z: 1, x: 1, y: 0 }, 5)).toEqual({ z: 0, x: 0, y: 0 });
  });
});

describe("frames", () => {
  interface Row {
    box: Box3;
    tile_px: number;
    res_m: number;
    views_deg: [number, number][];
    pinned: { zmax: number; size_m: number; views: FrameJson[] };
  }
  test.each(vectors<Row[]>("frames"))("the fixture pins $box like the vectors", (row) => {
    const { size, zmax, numbers } = pin(row.box, row.tile_px, row.res_m, row.views_deg);
    expect([size, zmax]).toEqual([row.pinned.size_m, row.pinned.zmax]);
    numbers.forEach((view, k) => {
      const want = row.pinned.views[k] as FrameJson;
      expect(view.id).toBe(want.id);
      for (const name of ["u0_m", "v0_m", "d0_m"] as const) expect(view[name]).toBeCloseTo(want[name], 8);
    });
  });
});

describe("occupancy", () => {
  test.each(vectors<{ zmax: number; occupied: [number, number][]; base64: string }[]>("occupancy"))(
    "$base64",
    ({ zmax, occupied, base64 }) => {
      const occupancy = new Occupancy(base64, zmax);
      const has = (z: number, x: number, y: number): boolean =>
        occupied.some(([bx, by]) => bx >> (zmax - z) === x && by >> (zmax - z) === y);
      for (let z = 0; z <= zmax; z++) {
        for (let y = 0; y < 2 ** z; y++) for (let x = 0; x < 2 ** z; x++) expect(occupancy.has({ z, x, y })).toBe(has(z, x, y));
      }
      expect(occupancy.has({ z: zmax + 1, x: 0, y: 0 })).toBe(false);
      expect(encodeOccupancy(zmax, ({ z, x, y }) => has(z, x, y))).toBe(base64);
    },
  );

  test("truncated bits are refused", () => {
    expect(() => new Occupancy("/w==", 6)).toThrow(/occupancy ends after 1 bytes/);
  });
});

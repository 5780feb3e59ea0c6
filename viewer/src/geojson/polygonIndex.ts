import type { Vec2 } from "../core/vec";

/** Average number of edges per band. */
const EDGES_PER_BAND = 2;
const MAX_BANDS = 4096;

/** Point-in-polygon index of a plane polygon with holes, by the even–odd rule. A point on an edge belongs to one of the two sides. */
export class PolygonIndex {
  /** Corners of the bounding box. */
  readonly low: Vec2;
  readonly high: Vec2;
  /** Edges as x0, y0, x1, y1, sorted into bands of y. */
  readonly #bands: readonly Float64Array[];
  readonly #bandHeight: number;

  constructor(rings: readonly (readonly Vec2[])[]) {
    let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
    for (const ring of rings) {
      for (const [x, y] of ring) [x0, y0, x1, y1] = [Math.min(x0, x), Math.min(y0, y), Math.max(x1, x), Math.max(y1, y)];
    }
    [this.low, this.high] = [
      [x0, y0],
      [x1, y1],
    ];
    const edges = rings.reduce((sum, ring) => sum + ring.length, 0);
    const count = Math.max(1, Math.min(MAX_BANDS, Math.ceil(edges / EDGES_PER_BAND)));
    this.#bandHeight = (y1 - y0) / count || 1;
    this.#bands = this.#sortEdges(rings, count);
  }

  contains(x: number, y: number): boolean {
    if (!(x >= this.low[0] && x <= this.high[0] && y >= this.low[1] && y <= this.high[1])) return false;
    const band = this.#bands[Math.min(Math.floor((y - this.low[1]) / this.#bandHeight), this.#bands.length - 1)] as Float64Array;
    let inside = false;
    for (let k = 0; k < band.length; k += 4) {
      const [y0, y1] = [band[k + 1] as number, band[k + 3] as number];
      if (y0 > y === y1 > y) continue;
      const [x0, x1] = [band[k] as number, band[k + 2] as number];
      if (x < x0 + ((x1 - x0) * (y - y0)) / (y1 - y0)) inside = !inside;
    }
    return inside;
  }

  #sortEdges(rings: readonly (readonly Vec2[])[], count: number): Float64Array[] {
    const bands: number[][] = Array.from({ length: count }, () => []);
    const bandOf = (y: number): number => Math.min(Math.max(Math.floor((y - this.low[1]) / this.#bandHeight), 0), count - 1);
    for (const ring of rings) {
      for (const [k, from] of ring.entries()) {
        const to = ring[(k + 1) % ring.length] as Vec2;
        if (from[1] === to[1]) continue;
        const last = bandOf(Math.max(from[1], to[1]));
        for (let band = bandOf(Math.min(from[1], to[1])); band <= last; band++) bands[band]?.push(...from, ...to);
      }
    }
    return bands.map((band) => new Float64Array(band));
  }
}

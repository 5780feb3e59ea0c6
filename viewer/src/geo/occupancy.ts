import { ManifestError } from "../core/errors";
import type { Tile } from "./frame";

/** The set of a view's tiles that have content: spec/manifest.md. Takes five bytes per tile. */
export class Occupancy {
  /** By level, for each occupied tile in Morton order: a bit for each child, and the index of its first child. */
  readonly #bits: Uint8Array[] = [];
  readonly #first: Uint32Array[] = [];
  readonly zmax: number;
  readonly #root: boolean;

  /** @param base64 breadth-first quadtree bits, least significant bit first */
  constructor(base64: string, zmax: number) {
    this.zmax = zmax;
    const read = makeBitReader(base64);
    this.#root = read() === 1;
    let count = this.#root ? 1 : 0;
    for (let z = 0; z < zmax; z++) count = this.#readLevel(count, read);
  }

  has({ z, x, y }: Tile): boolean {
    if (!this.#root || z > this.zmax) return false;
    let node = 0;
    for (let level = 0; level < z; level++) {
      const shift = z - level - 1;
      const quarter = (Math.floor(x / 2 ** shift) & 1) | ((Math.floor(y / 2 ** shift) & 1) << 1);
      const bits = this.#bits[level]?.[node] ?? 0;
      if (!((bits >> quarter) & 1)) return false;
      node = (this.#first[level]?.[node] ?? 0) + countBits(bits & ((1 << quarter) - 1));
    }
    return true;
  }

  #readLevel(count: number, read: () => number): number {
    const bits = new Uint8Array(count);
    const first = new Uint32Array(count);
    let next = 0;
    for (let node = 0; node < count; node++) {
      const four = read() | (read() << 1) | (read() << 2) | (read() << 3);
      bits[node] = four;
      first[node] = next;
      next += countBits(four);
    }
    this.#bits.push(bits);
    this.#first.push(first);
    return next;
  }
}

function countBits(four: number): number {
  return (four & 1) + ((four >> 1) & 1) + ((four >> 2) & 1) + ((four >> 3) & 1);
}

function makeBitReader(base64: string): () => number {
  const bytes = atob(base64);
  let at = 0;
  return () => {
    if (at >= bytes.length * 8) throw new ManifestError(`occupancy ends after ${String(bytes.length)} bytes; write rendering.json again`);
    const bit = (bytes.charCodeAt(at >> 3) >> (at & 7)) & 1;
    at++;
    return bit;
  };
}

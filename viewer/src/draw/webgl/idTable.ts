/** A hash table of ids with one word each, with open addressing as the shader searches it. */
export interface IdTable {
  /** Pairs of id and word (never 0). */
  readonly slots: Uint32Array;
  /** Number of slots − 1; a power of two − 1. */
  readonly mask: number;
  /** Length of the longest search. */
  readonly probes: number;
}

export function buildIdTable<T>(values: ReadonlyMap<number, T>, pack: (value: T) => number): IdTable {
  const ids = [...values].filter(([id]) => id > 0);
  const size = 2 ** Math.ceil(Math.log2(Math.max(ids.length * 2, 16)));
  const slots = new Uint32Array(size * 2);
  let probes = 1;
  for (const [id, value] of ids) probes = Math.max(probes, insert(slots, size - 1, id, pack(value)));
  return { slots, mask: size - 1, probes: probes + 1 };
}

/** Computes width and height of the texture for a table. */
export function computeTextureSize({ mask }: IdTable): [number, number] {
  const width = Math.min(mask + 1, 1024);
  return [width, (mask + 1) / width];
}

function insert(slots: Uint32Array, mask: number, id: number, word: number): number {
  let slot = (Math.imul(id, 0x9e3779b9) >>> 7) & mask;
  for (let probe = 1; ; probe++) {
    const existing = slots[2 * slot];
    if (existing === 0 || existing === id) {
      slots[2 * slot] = id;
      slots[2 * slot + 1] = word;
      return probe;
    }
    slot = (slot + 1) & mask;
  }
}

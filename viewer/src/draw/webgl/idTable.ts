/** Ids and a word for each in a table with open addressing, as the shader searches it. */
export interface IdTable {
  /** Places in pairs: id, word (never 0). */
  readonly slots: Uint32Array;
  /** Number of slots − 1; a power of two − 1. */
  readonly mask: number;
  /** The longest search. */
  readonly probes: number;
  /** The single entry, when there is just one. */
  readonly single: readonly [number, number];
}

export function buildIdTable<T>(values: ReadonlyMap<number, T>, wordOf: (value: T) => number): IdTable {
  const ids = [...values].filter(([id]) => id > 0);
  const size = 2 ** Math.ceil(Math.log2(Math.max(ids.length * 2, 16)));
  const slots = new Uint32Array(size * 2);
  let probes = 1;
  for (const [id, value] of ids) probes = Math.max(probes, insert(slots, size - 1, id, wordOf(value)));
  const first = ids.length === 1 ? ids[0] : undefined;
  return { slots, mask: size - 1, probes: probes + 1, single: first ? [first[0], wordOf(first[1])] : [0, 0] };
}

/** Width and height of the texture that holds a table. */
export function computeTextureSize({ mask }: IdTable): [number, number] {
  const width = Math.min(mask + 1, 1024);
  return [width, (mask + 1) / width];
}

function insert(slots: Uint32Array, mask: number, id: number, word: number): number {
  let place = (Math.imul(id, 0x9e3779b9) >>> 7) & mask;
  for (let probe = 1; ; probe++) {
    const there = slots[2 * place];
    if (there === 0 || there === id) {
      slots[2 * place] = id;
      slots[2 * place + 1] = word;
      return probe;
    }
    place = (place + 1) & mask;
  }
}

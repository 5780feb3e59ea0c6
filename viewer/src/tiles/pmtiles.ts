import { FetchError } from "../core/errors";
import type { Tile } from "../geo/frame";

/** Reads `length` bytes of an archive from `offset`. */
export type ReadRange = (offset: number, length: number, signal?: AbortSignal) => Promise<ArrayBuffer>;

interface DirectoryEntry {
  readonly id: number;
  readonly offset: number;
  readonly length: number;
  /** Number of consecutive tiles that share these bytes; 0: a leaf directory. */
  readonly run: number;
}

interface ArchiveHeader {
  readonly root: readonly [number, number];
  readonly leaves: number;
  readonly tiles: number;
  readonly internal: number;
  readonly compression: number;
}

const HEADER_BYTES = 127;
const FIRST_READ_BYTES = 16384;
const DEPTH_LIMIT = 4;

/** Returns a tile's id along the Hilbert curves of all levels: PMTiles v3. */
export function tileId({ z, x, y }: Tile): number {
  let id = (4 ** z - 1) / 3;
  let [a, b] = [x, y];
  for (let level = z - 1; level >= 0; level--) {
    const side = 2 ** level;
    const [rx, ry] = [(a >> level) & 1, (b >> level) & 1];
    id += side * side * ((3 * rx) ^ ry);
    if (ry === 0) {
      if (rx === 1) [a, b] = [side - 1 - (a & (side - 1)), side - 1 - (b & (side - 1))];
      [a, b] = [b, a];
    }
  }
  return id;
}

/** Reads tiles of a PMTiles v3 archive by byte ranges. Keeps its directories: about two bytes per tile. */
export class Archive {
  readonly #read: ReadRange;
  readonly #name: string;
  readonly #directories = new Map<number, Promise<DirectoryEntry[]>>();
  #header: Promise<ArchiveHeader> | undefined;

  /** @param open returns the reader of a file  @param part_bytes size of the files in which it is divided; undefined: it is one file */
  constructor(name: string, open: (path: string) => ReadRange, part_bytes?: number) {
    this.#name = name;
    this.#read = part_bytes ? (...range) => this.#readParts(open, part_bytes, ...range) : open(name);
  }

  /** Returns the name of a part of a divided archive. */
  static partName(path: string, part: number): string {
    return path.replace(/\.pmtiles$/, `.${String(part)}$&`);
  }

  #readParts(
    open: (path: string) => ReadRange,
    part_bytes: number,
    offset: number,
    length: number,
    signal?: AbortSignal,
  ): Promise<ArrayBuffer> {
    const pieces: Promise<ArrayBuffer>[] = [];
    for (let at = offset, size; at < offset + length; at += size) {
      const part = Math.floor(at / part_bytes);
      size = Math.min(offset + length, (part + 1) * part_bytes) - at;
      pieces.push(open(Archive.partName(this.#name, part))(at - part * part_bytes, size, signal));
    }
    return Promise.all(pieces).then((all) => new Blob(all).arrayBuffer());
  }

  /** Returns a tile's bytes; null when it is not in the archive. */
  async tile(tile: Tile, signal?: AbortSignal): Promise<ArrayBuffer | null> {
    const header = await (this.#header ??= this.#open());
    const id = tileId(tile);
    let [offset, length] = header.root;
    for (let depth = 0; depth < DEPTH_LIMIT; depth++) {
      const entry = findEntry(await this.#directory(header, offset, length), id);
      if (!entry) return null;
      if (entry.run > 0) return this.#decompress(await this.#read(header.tiles + entry.offset, entry.length, signal), header.compression);
      [offset, length] = [header.leaves + entry.offset, entry.length];
    }
    throw new FetchError(`${this.#name}: directories deeper than ${String(DEPTH_LIMIT)}`);
  }

  async #open(): Promise<ArchiveHeader> {
    try {
      const bytes = await this.#read(0, FIRST_READ_BYTES);
      const header = readHeader(bytes, this.#name);
      const [offset, length] = header.root;
      if (offset + length <= bytes.byteLength)
        void this.#parseDirectory(header, offset, Promise.resolve(bytes.slice(offset, offset + length)));
      return header;
    } catch (reason) {
      this.#header = undefined;
      throw reason;
    }
  }

  #directory(header: ArchiveHeader, offset: number, length: number): Promise<DirectoryEntry[]> {
    return this.#directories.get(offset) ?? this.#parseDirectory(header, offset, this.#read(offset, length));
  }

  #parseDirectory(header: ArchiveHeader, offset: number, bytes: Promise<ArrayBuffer>): Promise<DirectoryEntry[]> {
    const entries = bytes.then((packed) => this.#decompress(packed, header.internal)).then((plain) => readDirectory(new Uint8Array(plain)));
    this.#directories.set(offset, entries);
    entries.catch(() => this.#directories.delete(offset));
    return entries;
  }

  async #decompress(bytes: ArrayBuffer, compression: number): Promise<ArrayBuffer> {
    if (compression <= 1) return bytes;
    if (compression !== 2)
      throw new FetchError(`${this.#name}: unsupported compression ${String(compression)}; expected 1 (none) or 2 (gzip)`);
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
  }
}

function readHeader(bytes: ArrayBuffer, name: string): ArchiveHeader {
  const view = new DataView(bytes);
  if (bytes.byteLength < HEADER_BYTES || view.getUint32(0) !== 0x504d5469 || view.getUint8(7) !== 3) {
    throw new FetchError(`${name}: not a PMTiles archive of version 3`);
  }
  const long = (at: number): number => Number(view.getBigUint64(at, true));
  return { root: [long(8), long(16)], leaves: long(40), tiles: long(56), internal: view.getUint8(97), compression: view.getUint8(98) };
}

function readDirectory(bytes: Uint8Array): DirectoryEntry[] {
  let at = 0;
  const varint = (): number => {
    for (let value = 0, place = 1; ; place *= 128) {
      const byte = bytes[at++];
      if (byte === undefined) throw new FetchError("a PMTiles directory is truncated");
      value += (byte & 127) * place;
      if (byte < 128) return value;
    }
  };
  const column = (n: number): number[] => Array.from({ length: n }, varint);
  const n = varint();
  if (n > bytes.length) throw new FetchError(`a PMTiles directory of ${String(bytes.length)} bytes claims ${String(n)} entries`);
  const [steps, runs, lengths, offsets] = [column(n), column(n), column(n), column(n)];
  return makeEntries(steps, runs, lengths, offsets);
}

function makeEntries(steps: number[], runs: number[], lengths: number[], offsets: number[]): DirectoryEntry[] {
  const entries: DirectoryEntry[] = [];
  let id = 0;
  steps.forEach((step, k) => {
    id += step;
    const [before, given] = [entries[k - 1], offsets[k] ?? 0];
    const offset = given === 0 && before ? before.offset + before.length : given - 1;
    entries.push({ id, offset, length: lengths[k] ?? 0, run: runs[k] ?? 0 });
  });
  return entries;
}

/** Finds the entry that contains an id. */
function findEntry(entries: DirectoryEntry[], id: number): DirectoryEntry | null {
  let [low, high] = [0, entries.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((entries[middle]?.id ?? Infinity) <= id) low = middle + 1;
    else high = middle;
  }
  const entry = entries[low - 1];
  return entry && (entry.run === 0 || id - entry.id < entry.run) ? entry : null;
}

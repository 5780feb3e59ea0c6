import { DecodeError } from "./errors";
import { inflate } from "./inflate";

/** Bytes per pixel. */
type Channels = 1 | 2 | 3 | 4;

/** Pixels by rows from the top. */
export interface DecodedPng {
  readonly width: number;
  readonly height: number;
  readonly channels: Channels;
  readonly data: Uint8Array<ArrayBuffer>;
}

interface PngHeader {
  width: number;
  height: number;
  channels: Channels;
}

/** Channels of each colour type: grey, RGB, grey with alpha, RGBA. */
const CHANNELS: Partial<Record<number, Channels>> = { 0: 1, 2: 3, 4: 2, 6: 4 };

const SIGNATURE = [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a];
const SIDE_LIMIT = 4096;

/**
 * Decodes the PNGs of data layers (8 bits, grey or RGB with or without alpha, not interlaced) bit for bit, which a browser's
 * decoder does not: it multiplies by alpha, manages colours, or perturbs them. Verifies the checksum of the zlib stream, but
 * not those of the chunks.
 * @throws DecodeError
 */
export async function decodePng(bytes: Uint8Array<ArrayBuffer>): Promise<DecodedPng> {
  const { header, parts } = readChunks(bytes);
  const { width, height, channels } = header;
  const stride = width * channels;
  // Unfilters in place, since each row ends before the next begins: a worker collects garbage late.
  const raw = await inflate(parts, height * (stride + 1));
  for (let row = 0; row < height; row++) unfilter(raw, row, stride, channels);
  return { width, height, channels, data: raw.subarray(0, height * stride) };
}

function readChunks(bytes: Uint8Array<ArrayBuffer>): { header: PngHeader; parts: Uint8Array<ArrayBuffer>[] } {
  if (!SIGNATURE.every((byte, k) => bytes[k] === byte)) throw new DecodeError(`not a PNG (${String(bytes.length)} bytes)`);
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const parts: Uint8Array<ArrayBuffer>[] = [];
  let header: PngHeader | undefined;
  for (let at = 8; at + 12 <= bytes.length;) {
    const length = view.getUint32(at);
    const name = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    if (at + 12 + length > bytes.length) throw new DecodeError(`PNG is truncated in its ${name} chunk`);
    if (name === "IHDR") header = readHeader(view, at + 8, length);
    else if (name === "IDAT") parts.push(bytes.subarray(at + 8, at + 8 + length));
    else if (name === "IEND") break;
    at += 12 + length;
  }
  if (!header || parts.length === 0) throw new DecodeError("PNG has no IHDR or no IDAT chunk");
  return { header, parts };
}

function readHeader(view: DataView, at: number, length: number): PngHeader {
  if (length !== 13) throw new DecodeError(`PNG: IHDR of ${String(length)} bytes, expected 13`);
  const [width, height] = [view.getUint32(at), view.getUint32(at + 4)];
  const [depth, type, interlace] = [view.getUint8(at + 8), view.getUint8(at + 9), view.getUint8(at + 12)];
  const channels = CHANNELS[type];
  if (depth !== 8 || !channels || interlace !== 0) {
    throw new DecodeError(
      `PNG of ${String(depth)} bits, colour type ${String(type)}, interlace ${String(interlace)}; expected 8 bits, colour type 0, 2, 4 or 6, interlace 0`,
    );
  }
  if (width < 1 || height < 1 || width > SIDE_LIMIT || height > SIDE_LIMIT) {
    throw new DecodeError(`PNG of ${String(width)} × ${String(height)} pixels; expected 1 to ${String(SIDE_LIMIT)} a side`);
  }
  return { width, height, channels };
}

function unfilter(bytes: Uint8Array, row: number, stride: number, channels: number): void {
  const [from, to] = [row * (stride + 1) + 1, row * stride];
  const filter = bytes[from - 1] ?? 0;
  const undo = FILTERS[filter];
  if (!undo) throw new DecodeError(`PNG row ${String(row)} has filter ${String(filter)}`);
  undo(bytes, from, to, stride, channels, row > 0);
}

/** Writes `n` bytes at `to` from those at `from`, which comes after it; `c` bytes per pixel; the row above, if any, is `n` bytes before. */
type Unfilter = (bytes: Uint8Array, from: number, to: number, n: number, c: number, above: boolean) => void;

const plain: Unfilter = (out, from, to, n) => out.copyWithin(to, from, from + n);

const sub: Unfilter = (out, from, to, n, c) => {
  plain(out, from, to, n, c, false);
  for (let i = to + c; i < to + n; i++) out[i] = (out[i] as number) + (out[i - c] as number);
};

const up: Unfilter = (out, from, to, n, c, above) => {
  plain(out, from, to, n, c, false);
  if (above) for (let i = to; i < to + n; i++) out[i] = (out[i] as number) + (out[i - n] as number);
};

const average: Unfilter = (out, from, to, n, c, above) => {
  for (let i = 0; i < n; i++) {
    const left = i < c ? 0 : (out[to + i - c] as number);
    const over = above ? (out[to + i - n] as number) : 0;
    out[to + i] = (out[from + i] as number) + ((left + over) >> 1);
  }
};

const paeth: Unfilter = (out, from, to, n, c, above) => {
  if (!above) {
    sub(out, from, to, n, c, false);
    return;
  }
  for (let i = 0; i < c; i++) out[to + i] = (out[from + i] as number) + (out[to + i - n] as number);
  for (let i = c; i < n; i++) {
    const at = to + i;
    out[at] = (out[from + i] as number) + predictPaeth(out[at - c] as number, out[at - n] as number, out[at - n - c] as number);
  }
};

function predictPaeth(a: number, b: number, c: number): number {
  const pa = Math.abs(b - c);
  const pb = Math.abs(a - c);
  const pc = Math.abs(a + b - 2 * c);
  return pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
}

const FILTERS: readonly Unfilter[] = [plain, sub, up, average, paeth];

import { DecodeError } from "./errors";
import { inflate } from "./inflate";

/** What a data tile has for each pixel. */
export type DataKind = "normal" | "id" | "depth";

/** Pixels of one kind by rows from the top; normals: three bytes each. */
export interface DataTile {
  readonly kind: DataKind;
  readonly width: number;
  readonly height: number;
  readonly values: Uint8Array<ArrayBuffer> | Uint32Array<ArrayBuffer>;
}

/** "M3D" and the version. */
const MAGIC = 0x4d334401;
const HEADER_BYTES = 24;
const SIDE_LIMIT = 1024;
const BODY_BYTES_PER_PX = 31;
const NO_DEPTH = 0xffffffff;

/** Decodes the pixels of one kind from a data tile (spec/data-tile.md). Residuals are read, and checked, for depths only. @throws DecodeError */
export async function decodeDataTile(bytes: Uint8Array<ArrayBuffer>, kind: DataKind): Promise<DataTile> {
  const header = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  check(bytes.length >= HEADER_BYTES && header.getUint32(0) === MAGIC, `expected a data tile of version 1, not ${String(bytes[3])}`);
  const [sizes = 0, size = 0, runs = 0, labels = 0, residuals = 0] = [4, 8, 12, 16, 20].map((at) => header.getUint32(at, true));
  const [width, height] = [sizes & 0xffff, sizes >>> 16];
  const px = width * height;
  // Other rules of the header follow from what is read.
  check(px > 0 && width <= SIDE_LIMIT && height <= SIDE_LIMIT && size <= BODY_BYTES_PER_PX * px && runs <= px && labels <= px);
  return paint(kind, width, height, labels, readColumns(await inflate([bytes.subarray(HEADER_BYTES)], size), runs, labels, residuals));
}

function check(ok: boolean, message = "the data tile is broken"): void {
  if (!ok) throw new DecodeError(message);
}

const unfold = (n: number): number => (n % 2 ? -(n + 1) : n) / 2;

/** Columns of runs and labels; slopes and starts in units of depth; reads the next residual; tells whether everything was read. */
type Columns = readonly [
  codes: Float64Array,
  lengths: Float64Array,
  ids: Float64Array,
  normals: Float64Array,
  shapes: Float64Array,
  right: Float64Array,
  down: Float64Array,
  starts: Float64Array,
  residual: () => number,
  isDone: () => boolean,
];

/** Bytes beyond the end of a body read as NaN or 0; `isDone` is then false. */
function readColumns(body: Uint8Array, runs: number, labels: number, residuals: number): Columns {
  let [at, read] = [0, 0];
  const readByte = (): number => body[at++] as number;
  const column = (count: number, bytes: number): Float64Array => {
    const numbers = new Float64Array(count);
    for (let k = 0; k < bytes; k++) for (let i = 0; i < count; i++) numbers[i] = (numbers[i] as number) + readByte() * 256 ** k;
    return numbers;
  };
  const signed = (count: number, bytes: number): Float64Array => column(count, bytes).map((n) => unfold(n) / 16384);
  const codes = column(runs, 1);
  const lengths = column(codes.filter((code) => code & 4).length, 2).map(unfold);
  const [ids, normals, shapes] = [column(labels, 4), column(labels, 3), column(labels, 1)];
  const own = shapes.filter((shape) => (shape & 3) === 2).length;
  const slopes = [signed(own, 4), signed(own, 4)];
  const starts = signed(shapes.filter(Boolean).length, 6);

  // Slopes that labels share.
  const known = new Map<number, number>();
  let [id, seen] = [0, 0];
  const sources = shapes.map((shape, k) => {
    ids[k] = id ^= ids[k] as number;
    if ((shape & 3) === 2) known.set(normals[k] as number, seen++);
    const source = shape & 2 ? known.get(normals[k] as number) : own;
    check(shape < 8 && shape !== 4 && source !== undefined);
    return source as number;
  });
  const [right, down] = slopes.map((column) => sources.map((source) => column[source] ?? 0)) as [Float64Array, Float64Array];

  const fours = at;
  at += (residuals + 1) >> 1;
  check(!(residuals & 1) || (body[at - 1] as number) < 16);
  const readResidual = (): number => {
    let n = ((body[fours + (read >> 1)] as number) >> (4 * (read++ & 1))) & 15;
    if (n === 15) n += readByte();
    if (n === 270) for (let k = 0; k < 4; k++) n += readByte() * 256 ** k;
    return (n >>> 1) ^ -(n & 1);
  };
  return [codes, lengths, ids, normals, shapes, right, down, starts, readResidual, () => read === residuals && at === body.length];
}

function paint(
  kind: DataKind,
  width: number,
  height: number,
  labels: number,
  [codes, lengths, ids, normals, shapes, right, down, starts, readResidual, isDone]: Columns,
): DataTile {
  const values = kind === "normal" ? new Uint8Array(3 * width * height) : new Uint32Array(width * height);
  // For each label, the plane's depth at (0, 0) and the offset of the first pixel of the last run.
  const [zeros, offsets] = [ids.slice(), new Int32Array(labels)];
  let [run, begun, started, length] = [0, 0, 0, 0];
  // Ends and labels of the runs above.
  let [ends, owners]: [number[], number[]] = [[], []];
  for (let y = 0; y < height; y++) {
    const [rowEnds, rowOwners]: [number[], number[]] = [[], []];
    for (let x = 0, j = 0; x < width;) {
      const code = codes[run++] ?? 16;
      const from = y * width + x;
      while ((ends[j] as number) <= x) j++;
      const source = code & 3;
      const isNew = source === 2;
      const label = isNew ? begun++ : (owners[j + source] as number);
      const end = (isNew ? x : (ends[j + source] as number)) + (code & 4 ? (lengths[length++] as number) : 0);
      const [shape, color, slope] = [shapes[label] as number, normals[label] as number, right[label] as number];
      check(code < 16 && source < 3 && label < labels && end > x && end <= width && (shape > 0 || code < 8));
      const to = from + end - x;
      if (kind === "id") values.fill(ids[label] as number, from, to);
      else if (kind === "normal") {
        for (let i = 3 * from; i < 3 * to;) {
          values[i++] = color;
          values[i++] = color >> 8;
          values[i++] = color >> 16;
        }
      } else {
        const rise = slope * x + (down[label] as number) * y;
        if (isNew && shape) {
          const near = values[x > 0 ? from - 1 : from - width] ?? 0;
          const start = (starts[started++] as number) + (near === NO_DEPTH ? 0 : near);
          check(start >= 0 && start < 2 ** 32);
          zeros[label] = start - rise;
        }
        let value = (zeros[label] as number) + rise;
        let offset = offsets[label] as number;
        for (let i = from; i < to; i++, value += slope) {
          offset = ((shape & 4 ? offset : 0) + (code & 8 ? readResidual() : 0)) | 0;
          if (i === from) offsets[label] = offset;
          values[i] = shape ? Math.floor(value) + offset : NO_DEPTH;
        }
      }
      x = end;
      rowEnds.push(end);
      rowOwners.push(label);
    }
    [ends, owners] = [rowEnds, rowOwners];
  }
  check(run === codes.length && begun === labels && (kind !== "depth" || isDone()));
  return { kind, width, height, values };
}

/** What the header of an image says. */
export interface ImageHeader {
  readonly mediaType: "image/png" | "image/jpeg" | "image/webp";
  readonly width: number;
  readonly height: number;
  /** Does the file have its end? */
  readonly complete: boolean;
}

/** Reads the header of a PNG, JPEG or WebP image, before anything is decoded; null for other bytes. */
export function readImageHeader(bytes: Uint8Array): ImageHeader | null {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const at = (offset: number, text: string): boolean =>
    offset + text.length <= bytes.length &&
    Array.from({ length: text.length }, (_, k) => text.charCodeAt(k)).every((code, k) => bytes[offset + k] === code);
  if (at(0, "\x89PNG\r\n\x1a\n") && bytes.length >= 33) {
    return { mediaType: "image/png", width: view.getUint32(16), height: view.getUint32(20), complete: at(bytes.length - 8, "IEND") };
  }
  if (at(0, "\xff\xd8\xff")) return readJpeg(view);
  if (at(0, "RIFF") && at(8, "WEBP") && bytes.length >= 30) return readWebp(view, at);
  return null;
}

/** Colour type of a PNG: 2 for RGB, 6 for RGBA. */
export const pngColorType = (bytes: ArrayBuffer): number => new Uint8Array(bytes)[25] ?? -1;

/** Bytes after the end marker that some cameras and servers append. */
const JPEG_TRAILER = 64;

/** Reads the first frame header: markers C0 to CF except C4, C8 and CC. */
function readJpeg(view: DataView): ImageHeader | null {
  for (let at = 2; at + 9 < view.byteLength && view.getUint8(at) === 0xff;) {
    const marker = view.getUint8(at + 1);
    if (marker === 0xff) {
      at++;
      continue;
    }
    if (marker >= 0xc0 && marker <= 0xcf && marker !== 0xc4 && marker !== 0xc8 && marker !== 0xcc) {
      return { mediaType: "image/jpeg", width: view.getUint16(at + 7), height: view.getUint16(at + 5), complete: hasJpegEnd(view) };
    }
    at += 2 + view.getUint16(at + 2);
  }
  return null;
}

function hasJpegEnd(view: DataView): boolean {
  for (let at = view.byteLength - 2; at >= Math.max(2, view.byteLength - JPEG_TRAILER); at--)
    if (view.getUint16(at) === 0xffd9) return true;
  return false;
}

function readWebp(view: DataView, at: (offset: number, text: string) => boolean): ImageHeader | null {
  const complete = view.getUint32(4, true) + 8 <= view.byteLength;
  const make = (width: number, height: number): ImageHeader => ({ mediaType: "image/webp", width, height, complete });
  if (at(12, "VP8 ")) return make(view.getUint16(26, true) & 0x3fff, view.getUint16(28, true) & 0x3fff);
  if (at(12, "VP8L")) return make((view.getUint32(21, true) & 0x3fff) + 1, ((view.getUint32(21, true) >>> 14) & 0x3fff) + 1);
  if (at(12, "VP8X")) return make((view.getUint32(24, true) & 0xffffff) + 1, (view.getUint32(26, true) >>> 8) + 1);
  return null;
}

/** A part of a multipart message. */
export interface MessagePart {
  /** Media type without parameters, lower case. */
  readonly mediaType: string;
  readonly bytes: ArrayBuffer;
}

/** The boundary of OGC 15-001r4 §10.6, for servers that do not name it. */
const STANDARD_BOUNDARY = "3DPS_MULTIPART_MESSAGE_BOUNDARY";
const MAX_HEADER_BYTES = 4096;

/** Returns a content type without its parameters. */
export const essenceOf = (contentType: string): string => (contentType.split(";")[0] ?? "").trim().toLowerCase();

/** Splits a multipart message (RFC 2046 §5.1); null when it is cut or malformed. */
export function splitMultipart(message: ArrayBuffer, contentType: string): MessagePart[] | null {
  const [, quoted, plain] = /;\s*boundary\s*=\s*(?:"([^"]+)"|([^\s;]+))/i.exec(contentType) ?? [];
  const bytes = new Uint8Array(message);
  const delimiter = new TextEncoder().encode(`--${quoted ?? plain ?? STANDARD_BOUNDARY}`);
  const parts: MessagePart[] = [];
  for (let from = findDelimiter(bytes, delimiter, 0); from >= 0;) {
    const start = from + delimiter.length;
    if (bytes[start] === DASH && bytes[start + 1] === DASH) return parts;
    const next = findDelimiter(bytes, delimiter, start);
    if (next < 0) return null;
    const part = readPart(bytes, start, next);
    if (!part) return null;
    parts.push(part);
    from = next;
  }
  return null;
}

const [CR, LF, DASH] = [13, 10, 45];

/** Finds the delimiter at the beginning of a line; -1 without one. */
function findDelimiter(bytes: Uint8Array, delimiter: Uint8Array, from: number): number {
  for (let at = bytes.indexOf(DASH, from); at >= 0; at = bytes.indexOf(DASH, at + 1)) {
    if ((at === 0 || bytes[at - 1] === LF) && delimiter.every((byte, k) => bytes[at + k] === byte)) return at;
  }
  return -1;
}

/** Reads the part between two delimiters; null without a header. */
function readPart(bytes: Uint8Array, start: number, end: number): MessagePart | null {
  let at = bytes.indexOf(LF, start) + 1;
  let mediaType = "";
  for (const limit = at + MAX_HEADER_BYTES; ;) {
    const lineEnd = bytes.indexOf(LF, at);
    if (at === 0 || lineEnd < 0 || lineEnd >= end || lineEnd > limit) return null;
    const line = new TextDecoder("latin1").decode(bytes.subarray(at, lineEnd)).trim();
    at = lineEnd + 1;
    if (line === "") break;
    const [, name = "", value = ""] = /^([^:]+):\s*(.*)$/.exec(line) ?? [];
    if (name.toLowerCase() === "content-type") mediaType = essenceOf(value);
  }
  // The line break before a delimiter belongs to it.
  const last = bytes[end - 2] === CR ? end - 2 : end - 1;
  return last >= at ? { mediaType, bytes: bytes.slice(at, last).buffer } : null;
}

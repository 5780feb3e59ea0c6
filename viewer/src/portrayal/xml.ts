import { PortrayalError } from "./portrayalError";

/**
 * Parses an untrusted XML document. Refuses document types, and so entities.
 * @throws PortrayalError
 */
export function parseXml(bytes: ArrayBuffer, where: string): Element {
  const text = decode(bytes, where);
  if (/<!(DOCTYPE|ENTITY)/i.test(text)) throw new PortrayalError(`${where}: the XML has a document type declaration, which map3d refuses`);
  const root = new DOMParser().parseFromString(text, "application/xml").documentElement;
  if (root.localName === "parsererror" || root.getElementsByTagName("parsererror").length > 0)
    throw new PortrayalError(`${where}: the answer is not well-formed XML`);
  return root;
}

/** Decodes the encoding that a byte order mark or the XML declaration names, UTF-8 by default. */
function decode(bytes: ArrayBuffer, where: string): string {
  const head = new Uint8Array(bytes, 0, Math.min(bytes.byteLength, 200));
  const [a = 0, b = 0] = head;
  const mark = a === 0xfe && b === 0xff ? "utf-16be" : a === 0xff && b === 0xfe ? "utf-16le" : null;
  const declared = /^\s*<\?xml[^>]*\bencoding\s*=\s*["']([\w.-]+)["']/.exec(
    new TextDecoder("latin1").decode(head).replace(/^\u00ef\u00bb\u00bf/, ""),
  );
  const label = mark ?? declared?.[1] ?? "utf-8";
  try {
    return new TextDecoder(label, { fatal: true }).decode(bytes);
  } catch {
    throw new PortrayalError(`${where}: the XML is not valid ${label.slice(0, 40)}`);
  }
}

/** Returns the children with a local name, whatever their prefix: servers qualify the elements in different ways. */
export const childrenNamed = (parent: Element | null | undefined, name: string): Element[] =>
  parent ? [...parent.children].filter((child) => child.localName === name) : [];

/** Returns the first element below `parent`, child by child. */
export function findBelow(parent: Element | null | undefined, ...path: readonly string[]): Element | undefined {
  let found: Element | undefined = parent ?? undefined;
  for (const name of path) found = childrenNamed(found, name)[0];
  return found;
}

/** Returns the trimmed text of an element, at most `limit` characters. */
export const textOf = (element: Element | null | undefined, limit = 1000): string => (element?.textContent ?? "").trim().slice(0, limit);

/** Returns an attribute by its local name, in any case. */
export function attributeOf(element: Element | undefined, name: string): string | null {
  for (const attribute of element?.attributes ?? []) if (attribute.localName.toLowerCase() === name.toLowerCase()) return attribute.value;
  return null;
}

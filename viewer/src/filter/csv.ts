import type { Attribute, ImageLayer, Map3D, ObjectInfo } from "../map3d";

/** Number of objects whose attributes are read at a time. */
const AT_ONCE = 32;
const FIXED = ["id", "name", "class"] as const;

/**
 * Writes objects as CSV (RFC 4180, UTF-8): one row each, with id, name, class and all their attributes. Values stay as they are stored, except that an apostrophe
 * precedes a text that a spreadsheet would run as a formula.
 */
export function toCsv(objects: readonly (readonly [id: number, object: ObjectInfo])[]): string {
  const names = [...new Set(objects.flatMap(([, { attributes }]) => Object.keys(attributes)))].sort();
  const rows = objects.map(([id, object]) => [id, object.name, object.class, ...names.map((name) => object.attributes[name] ?? null)]);
  // An attribute may have the name of a column that every object has.
  return [[...FIXED, ...names.map((name) => (FIXED.some((fixed) => fixed === name) ? `attribute:${name}` : name))], ...rows]
    .map((row) => `${row.map(toField).join(",")}\r\n`)
    .join("");
}

/** Writes the objects in view as CSV, the largest first, or some objects of a layer, such as the selected ones. Fetches the ids in view and the attributes. */
export async function exportCsv(map: Map3D, { layer, ids }: CsvOptions = {}): Promise<string> {
  const first = layer ?? map.layers[0];
  const wanted =
    ids && first ? ids.map((id) => ({ id, layer: first })) : (await map.objectsInView()).filter((seen) => !layer || seen.layer === layer);
  const found: [number, ObjectInfo][] = [];
  for (let k = 0; k < wanted.length; k += AT_ONCE) {
    const objects = await Promise.all(wanted.slice(k, k + AT_ONCE).map(async (one) => [one.id, await one.layer.object(one.id)] as const));
    for (const [id, object] of objects) if (object) found.push([id, object]);
  }
  return toCsv(found);
}

/** Options of `exportCsv`. */
export interface CsvOptions {
  /** Layer of the objects. Default: all layers, or the map's first one with `ids`. */
  layer?: ImageLayer;
  /** Objects to write. Default: those in view. */
  ids?: readonly number[];
}

/** What a spreadsheet may take for a formula (OWASP, "CSV Injection"): these characters at the beginning, unless the whole text is a number. */
const FORMULA = /^(?![+-]?\d+(?:\.\d+)?$)[=+\-@\t\r\n\uff1d\uff0b\uff0d\uff20]/;

function toField(value: Attribute): string {
  const plain = value === null ? "" : String(value);
  const text = typeof value === "string" && FORMULA.test(plain) ? `'${plain}` : plain;
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

import { UsageError, type AnyPosition, type Light, type Mode, type Vec3 } from "../map3d";

/** Base class of the elements. Without a DOM, such as in server-side rendering, the classes can be imported but not used. */
export const PageElement = (globalThis as Partial<typeof globalThis>).HTMLElement ?? (class {} as typeof HTMLElement);

/** Returns the words of an attribute, separated by white space; an empty list when it is missing. */
export const words = (element: Element, name: string): string[] =>
  (element.getAttribute(name) ?? "").split(/\s+/).filter((word) => word !== "");

/** Parses a position in the scene's CRS, metres. @throws UsageError */
export const position = (element: Element, name: string): Vec3 | undefined =>
  numbers(element, name, 3, 'three numbers such as "691000 5336000 520"') as Vec3 | undefined;

/** Parses the place of an element: `lonlat` (degrees) on the ground, or coordinates of the scene's CRS. @param name attribute of the coordinates  @throws UsageError */
export function place(element: Element, name: string): AnyPosition | undefined {
  const lonLat = numbers(element, "lonlat", 2, 'longitude and latitude in degrees, such as "11.42 48.76"') as [number, number] | undefined;
  return lonLat ? { lonLat } : position(element, name);
}

/** Parses a number. @throws UsageError */
export const number = (element: Element, name: string): number | undefined => numbers(element, name, 1, "a number")?.[0];

/** Parses "azimuth elevation", degrees. @throws UsageError */
export function light(element: Element): Partial<Light> | undefined {
  const [azimuth_deg, elevation_deg] = numbers(element, "light", 2, 'azimuth and elevation in degrees, such as "215 48"') ?? [];
  return azimuth_deg === undefined || elevation_deg === undefined ? undefined : { azimuth_deg, elevation_deg };
}

/** Parses "now" or a time that `Date` understands, such as 2026-06-21T14:00Z. @throws UsageError */
export function time(element: Element): Date | undefined {
  const text = element.getAttribute("time")?.trim() ?? "";
  if (text === "") return undefined;
  const parsed = text === "now" ? new Date() : new Date(text);
  if (Number.isNaN(parsed.getTime())) throw invalid(element, "time", 'a time such as "2026-06-21T14:00Z", or "now"');
  return parsed;
}

/** Returns the mode; the layer validates it. */
export const mode = (element: Element): Mode | undefined => (element.getAttribute("mode") ?? undefined) as Mode | undefined;

/** Returns false for "off" and "false", undefined when the attribute is missing, else true. */
export function isOn(element: Element, name: string): boolean | undefined {
  const text = element.getAttribute(name);
  return text === null ? undefined : text !== "off" && text !== "false";
}

function numbers(element: Element, name: string, count: number, expected: string): number[] | undefined {
  const list = (element.getAttribute(name) ?? "").split(/[\s,]+/).filter((word) => word !== "");
  if (list.length === 0) return undefined;
  const values = list.map(Number);
  if (values.length !== count || !values.every(Number.isFinite)) throw invalid(element, name, expected);
  return values;
}

const invalid = (element: Element, name: string, expected: string): UsageError =>
  new UsageError(`<${element.localName} ${name}="${element.getAttribute(name) ?? ""}">: ${name} must be ${expected}`);

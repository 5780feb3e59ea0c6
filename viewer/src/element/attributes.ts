import { UsageError, type Light, type Mode, type Vec3 } from "../map3d";

/** What an element can be made of where there is no page: on a server that renders, the classes can be imported, not used. */
export const PageElement = (globalThis as Partial<typeof globalThis>).HTMLElement ?? (class {} as typeof HTMLElement);

/** Words of an attribute, separated by white space; none when it is missing. */
export const words = (element: Element, name: string): string[] => (element.getAttribute(name) ?? "").split(/\s+/).filter((word) => word !== "");

/** A position of the scene's CRS, metres. @throws UsageError */
export const position = (element: Element, name: string): Vec3 | undefined => numbers(element, name, 3, "three numbers such as \"691000 5336000 520\"") as Vec3 | undefined;

/** @throws UsageError */
export const number = (element: Element, name: string): number | undefined => numbers(element, name, 1, "a number")?.[0];

/** From "azimuth altitude", degrees. @throws UsageError */
export function light(element: Element): Partial<Light> | undefined {
  const [azimuth_deg, altitude_deg] = numbers(element, "light", 2, "azimuth and altitude in degrees, such as \"215 48\"") ?? [];
  return azimuth_deg === undefined || altitude_deg === undefined ? undefined : { azimuth_deg, altitude_deg };
}

/** "now", or a moment that the browser understands, such as 2026-06-21T14:00Z. @throws UsageError */
export function time(element: Element): Date | undefined {
  const text = element.getAttribute("time")?.trim() ?? "";
  if (text === "") return undefined;
  const found = text === "now" ? new Date() : new Date(text);
  if (Number.isNaN(found.getTime())) throw wrong(element, "time", "a moment such as \"2026-06-21T14:00Z\", or \"now\"");
  return found;
}

/** The layer checks it. */
export const mode = (element: Element): Mode | undefined => (element.getAttribute("mode") ?? undefined) as Mode | undefined;

/** false for "off" and "false"; undefined when it is missing. */
export function isOn(element: Element, name: string): boolean | undefined {
  const text = element.getAttribute(name);
  return text === null ? undefined : text !== "off" && text !== "false";
}

function numbers(element: Element, name: string, count: number, such: string): number[] | undefined {
  const list = (element.getAttribute(name) ?? "").split(/[\s,]+/).filter((word) => word !== "");
  if (list.length === 0) return undefined;
  const found = list.map(Number);
  if (found.length !== count || !found.every(Number.isFinite)) throw wrong(element, name, such);
  return found;
}

const wrong = (element: Element, name: string, such: string): UsageError => new UsageError(`<${element.localName} ${name}="${element.getAttribute(name) ?? ""}">: ${name} is ${such}`);

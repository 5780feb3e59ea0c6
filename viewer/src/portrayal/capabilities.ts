import type { Vec3 } from "../core/vec";
import { PortrayalError } from "./portrayalError";
import { attributeOf, childrenNamed, findBelow, textOf } from "./xml";

/** A bounding box in the order of a system's axes. */
export interface ServiceBox {
  /** Empty: that of the layer. */
  readonly crs: string;
  readonly low: readonly number[];
  readonly high: readonly number[];
}

/** A layer of a service, with what it inherits. */
export interface ServiceLayer {
  readonly identifier: string;
  readonly title: string;
  readonly crs: readonly string[];
  readonly styles: readonly string[];
  readonly boxes: readonly ServiceBox[];
  /** Degrees, longitude first. */
  readonly lonLatBox: ServiceBox | null;
  readonly queryable: boolean;
  /** Names and URLs of the manifests of map3d renderings. */
  readonly renderings: readonly (readonly [name: string, url: string])[];
}

/** A parameter of a projection. */
export interface ProjectionParameter {
  /** Lower case, letters and digits only: "pocx1", "poc", "left". */
  readonly name: string;
  readonly required: boolean;
}

/** An image layer of a service. */
export interface OfferedImageLayer {
  readonly identifier: string;
  readonly formats: readonly string[];
}

/** An operation of a service. */
export interface ServiceOperation {
  readonly url: string | null;
  readonly formats: readonly string[];
  /** Names in lower case. */
  readonly parameters: ReadonlySet<string>;
}

/** What a 3D Portrayal Service offers. */
export interface Capabilities {
  readonly provider: string;
  readonly operations: ReadonlyMap<string, ServiceOperation>;
  readonly layers: readonly ServiceLayer[];
  /** Formats of each image layer by its name in capitals, and the name that requests use. */
  readonly imageLayers: ReadonlyMap<string, OfferedImageLayer>;
  /** Parameters of the orthographic projection in the order of the request; null: not listed. */
  readonly orthographic: readonly ProjectionParameter[] | null;
  /** Whether one answer may have several images. */
  readonly multipart: boolean;
}

/** Role of the links from a layer to its renderings. */
const RENDERING_ROLE = "urn:map3d:def:rendering";
const MAX_LAYERS = 10_000;
const MAX_NESTING = 32;
/** Longest name that a request repeats. */
const MAX_NAME = 500;

/** Reads a capabilities document (OGC 15-001r4 §8.3), with or without qualified elements. @throws PortrayalError */
export function readCapabilities(root: Element, where: string): Capabilities {
  if (root.localName !== "Capabilities")
    throw new PortrayalError(
      `${where}: expected the capabilities of a 3D Portrayal Service, got the element ${root.localName.slice(0, 60)}`,
    );
  const service = textOf(findBelow(root, "ServiceIdentification", "ServiceType"), 40);
  if (service && !/3DPS/i.test(service)) throw new PortrayalError(`${where}: expected the service 3DPS, got ${service}`);
  const view = findBelow(root, "PortrayalCapabilities", "Extensions", "ViewPortrayalCapabilitiesExtension");
  const layers: ServiceLayer[] = [];
  collectLayers(findBelow(root, "Contents"), { crs: [], queryable: false }, layers, where);
  return {
    provider: textOf(findBelow(root, "ServiceProvider", "ProviderName"), 200),
    operations: new Map(
      childrenNamed(findBelow(root, "OperationsMetadata"), "Operation").map((operation) => [
        attributeOf(operation, "name") ?? "",
        readOperation(operation),
      ]),
    ),
    layers,
    imageLayers: readImageLayers(view),
    orthographic: readProjection(view),
    multipart:
      textOf(childrenNamed(view, "SupportsMultipleViews")[0] ?? childrenNamed(view, "supportsMultipleViews")[0]).toLowerCase() !== "false",
  };
}

type Inherited = Pick<ServiceLayer, "crs" | "queryable">;

function collectLayers(parent: Element | undefined, inherited: Inherited, found: ServiceLayer[], where: string, depth = 0): void {
  if (depth > MAX_NESTING) throw new PortrayalError(`${where}: layers are nested deeper than ${String(MAX_NESTING)}`);
  for (const element of childrenNamed(parent, "Layer")) {
    if (found.length >= MAX_LAYERS) throw new PortrayalError(`${where}: more than ${String(MAX_LAYERS)} layers`);
    const layer = readLayer(element, inherited);
    if (layer.identifier) found.push(layer);
    collectLayers(element, layer, found, where, depth + 1);
  }
}

function readLayer(element: Element, inherited: Inherited): ServiceLayer {
  const texts = (name: string): string[] =>
    childrenNamed(element, name)
      .map((child) => textOf(child, MAX_NAME))
      .filter(Boolean);
  const queryable = attributeOf(findBelow(element, "Extensions", "InfoLayerExtension"), "queryable");
  const [lonLatBox = null] = childrenNamed(element, "WGS84BoundingBox").flatMap(readBox);
  return {
    identifier: textOf(findBelow(element, "Identifier"), MAX_NAME),
    title: textOf(findBelow(element, "Title")),
    crs: [...new Set([...texts("AvailableCRS"), ...inherited.crs])],
    styles: childrenNamed(element, "AvailableStyle").map((style) => textOf(findBelow(style, "Identifier"), MAX_NAME)),
    boxes: childrenNamed(element, "BoundingBox").flatMap(readBox),
    lonLatBox,
    queryable: queryable === null ? inherited.queryable : /^(true|1)$/i.test(queryable),
    renderings: childrenNamed(element, "Metadata")
      .filter((link) => attributeOf(link, "role") === RENDERING_ROLE)
      .map((link) => [attributeOf(link, "title") ?? "", attributeOf(link, "href") ?? ""] as const),
  };
}

/** Returns no box unless both corners have two or three finite numbers in order. */
function readBox(element: Element): ServiceBox[] {
  const corner = (name: string): number[] =>
    textOf(findBelow(element, name))
      .split(/[\s,]+/)
      .filter(Boolean)
      .map(Number);
  const [low, high] = [corner("LowerCorner"), corner("UpperCorner")];
  const ok =
    low.length === high.length &&
    (low.length === 2 || low.length === 3) &&
    low.every((value, k) => Number.isFinite(value) && Number.isFinite(high[k]) && value <= Number(high[k]));
  return ok ? [{ crs: attributeOf(element, "crs") ?? "", low, high }] : [];
}

function readOperation(operation: Element): ServiceOperation {
  const parameters = new Map(childrenNamed(operation, "Parameter").map((one) => [attributeOf(one, "name")?.toLowerCase() ?? "", one]));
  const formats = childrenNamed(findBelow(parameters.get("format"), "AllowedValues"), "Value").map((value) =>
    textOf(value, 100).toLowerCase(),
  );
  return { url: attributeOf(findBelow(operation, "DCP", "HTTP", "Get"), "href"), formats, parameters: new Set(parameters.keys()) };
}

/** Image layers may be named by the URIs of the standard. Without any, a service has COLOR. */
function readImageLayers(view: Element | undefined): Capabilities["imageLayers"] {
  const found = childrenNamed(view, "AvailableImageLayer").map((element) => {
    const identifier = textOf(findBelow(element, "Identifier"), MAX_NAME);
    const formats = childrenNamed(element, "AvailableFormat")
      .map((format) => textOf(format, 100))
      .filter(Boolean);
    return [identifier.replace(/^.*[/#]/, "").toUpperCase(), { identifier, formats }] as const;
  });
  return found.length > 0 ? new Map(found.reverse()) : new Map([["COLOR", { identifier: "COLOR", formats: ["image/png", "image/jpeg"] }]]);
}

function readProjection(view: Element | undefined): ProjectionParameter[] | null {
  const isOrthographic = (projection: Element): boolean =>
    ["Identifier", "TypeName"].some(
      (name) =>
        textOf(findBelow(projection, name))
          .replace(/^.*[/#:]/, "")
          .toLowerCase() === "orthographic",
    );
  const projections = childrenNamed(view, "AvailableProjection");
  const found = projections.find(isOrthographic);
  if (!found) return projections.length > 0 ? [] : null;
  const parameters = childrenNamed(found, "ProjectionParameter");
  return parameters.length === 0
    ? null
    : parameters.map((element) => ({
        name: (attributeOf(element, "name") ?? "").toLowerCase().replace(/[^a-z0-9]/g, ""),
        required: attributeOf(element, "required")?.toLowerCase() !== "false",
      }));
}

/** A box as easting, northing and height. */
export function toEastNorth(box: ServiceBox, northFirst: boolean, heights: readonly [number, number]): readonly [Vec3, Vec3] {
  const turn = ([first = 0, second = 0, height]: readonly number[], missing: number): Vec3 => [
    northFirst ? second : first,
    northFirst ? first : second,
    height ?? missing,
  ];
  return [turn(box.low, heights[0]), turn(box.high, heights[1])];
}

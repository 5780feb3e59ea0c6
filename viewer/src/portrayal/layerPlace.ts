import { boxCenter, sub, type Box3 } from "../core/vec";
import { UsageError } from "../map3d";
import { epsgOf, isNorthFirst, isSameSystem } from "./axisOrder";
import { toEastNorth, type Capabilities, type ServiceBox, type ServiceLayer } from "./capabilities";
import type { PortrayalOptions } from "./options";
import { PortrayalError } from "./portrayalError";

/** Where the requested layers are. */
export interface LayerPlace {
  /** The service's name of the coordinate system. */
  readonly crs: string;
  readonly epsg: number | null;
  readonly northFirst: boolean;
  /** Easting, northing, height. */
  readonly box: Box3;
}

/** Names and codes of geographic systems that are often used. */
const GEOGRAPHIC = /CRS:?84|EPSG\b.*[:/#](4326|4979|4258|4937|4267|4269)$/i;
/** A degree of latitude, metres. */
const DEGREE_M = 111_200;
/** A box is checked against its longitudes and latitudes if it is at least so large, and may differ by this factor. */
const [CHECKED_M, SAME_UNIT] = [20, 2] as const;

/** Finds the layers of a request. @throws UsageError, PortrayalError */
export function chooseLayers({ layers }: Capabilities, { layers: wanted, styles = [] }: PortrayalOptions, where: string): ServiceLayer[] {
  const known = (): string =>
    layers
      .slice(0, 20)
      .map(({ identifier }) => identifier)
      .join(", ");
  const names = typeof wanted === "string" ? [wanted] : (wanted ?? []);
  if (layers.length === 0) throw new PortrayalError(`${where}: the service lists no layer`);
  const chosen =
    names.length === 0
      ? [layers.find(({ boxes }) => boxes.length > 0) ?? layers[0]]
      : names.map((name) => layers.find(({ identifier }) => identifier === name) ?? name);
  const missing = chosen.find((one) => typeof one === "string");
  if (missing !== undefined) throw new UsageError(`${where} has no layer "${missing}"; it has ${known()}`);
  if (styles.length > 0 && styles.length !== chosen.length)
    throw new UsageError(`styles: expected one per layer, got ${String(styles.length)} for ${String(chosen.length)}`);
  return chosen as ServiceLayer[];
}

/** Chooses the coordinate system and the box that encloses all layers. @throws UsageError, PortrayalError */
export function placeLayers(layers: readonly ServiceLayer[], options: PortrayalOptions, where: string): LayerPlace {
  const [first, ...others] = layers as [ServiceLayer, ...ServiceLayer[]];
  const shared = first.crs.filter((crs) => others.every((layer) => layer.crs.some((other) => isSameSystem(crs, other))));
  const listed = shared.join(", ") || "none";
  if (options.crs !== undefined && !shared.some((crs) => isSameSystem(crs, options.crs as string)))
    throw new UsageError(`${where}: the layer is not available in ${options.crs}; it has ${listed}`);
  const candidates = options.crs === undefined ? shared.filter((crs) => !GEOGRAPHIC.test(crs)) : [options.crs];
  const crs = candidates.find(
    (one) => options.box !== undefined || layers.every((layer) => findBox(layer, one) !== undefined && !isGeographic(layer, one)),
  );
  if (crs === undefined)
    throw new PortrayalError(
      `${where}: layer ${first.identifier} has no bounding box in a projected coordinate system; it has ${listed}. Give the options crs and box`,
    );
  const epsg = epsgOf(crs);
  const northFirst = options.axes === undefined ? epsg !== null && isNorthFirst(epsg) : options.axes === "north-east";
  if (options.box) return { crs, epsg, northFirst, box: options.box };
  const boxes = layers.map((layer) => readBox(layer, findBox(layer, crs) as ServiceBox, northFirst, where));
  const low = ([0, 1, 2] as const).map((k) => Math.min(...boxes.map((box) => box[0][k])));
  const high = ([0, 1, 2] as const).map((k) => Math.max(...boxes.map((box) => box[1][k])));
  return { crs, epsg, northFirst, box: [low, high] as unknown as Box3 };
}

/** Returns the box of a layer in a system. A box without a system is in that of the layer's first one. */
const findBox = ({ boxes, crs: [first = ""] }: ServiceLayer, crs: string): ServiceBox | undefined =>
  boxes.find((box) => isSameSystem(box.crs || first, crs));

/** Are the numbers of the box those of its longitudes and latitudes? */
function isGeographic(layer: ServiceLayer, crs: string): boolean {
  const [box, degrees] = [findBox(layer, crs), layer.lonLatBox];
  if (!box || !degrees) return false;
  const near = (axes: readonly [number, number]): boolean =>
    axes.every((axis, k) => Math.abs(Number(box.low[k]) - Number(degrees.low[axis])) < 0.1);
  return near([0, 1]) || near([1, 0]);
}

function readBox(layer: ServiceLayer, box: ServiceBox, northFirst: boolean, where: string): Box3 {
  if (box.low.length < 3)
    throw new PortrayalError(`${where}: the bounding box of layer ${layer.identifier} has no heights; give the option box`);
  const found = toEastNorth(box, northFirst, [0, 0]);
  checkUnit(layer, found, where);
  return found;
}

/** Compares the size of a box with that of its longitudes and latitudes, to notice systems in feet. @throws PortrayalError */
function checkUnit({ identifier, lonLatBox }: ServiceLayer, box: Box3, where: string): void {
  if (!lonLatBox) return;
  const [west = 0, south = 0] = lonLatBox.low;
  const [east = 0, north = 0] = lonLatBox.high;
  const metres = Math.hypot((east - west) * Math.cos(((south + north) * Math.PI) / 360), north - south) * DEGREE_M;
  const units = Math.hypot(...sub(box[1], box[0]).slice(0, 2));
  if (metres < CHECKED_M || (units / metres < SAME_UNIT && metres / units < SAME_UNIT)) return;
  throw new PortrayalError(
    `${where}: the bounding box of layer ${identifier} is ${units.toFixed(0)} units wide, but ${metres.toFixed(0)} m by its longitudes and latitudes; map3d needs a coordinate system in metres`,
  );
}

/** Returns the origin of local coordinates: the centre of the box's base, in whole metres. */
export function originOf(box: Box3): readonly [number, number, number] {
  const [x, y] = boxCenter(box);
  return [Math.round(x), Math.round(y), Math.floor(box[0][2])];
}

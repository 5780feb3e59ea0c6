import type { Frame } from "../geo/frame";
import type { ManifestJson, Rendering, View } from "../geo/manifest";

/** Finds the view of a rendering with the look-at angle and pitch of a frame, whatever its id. */
export function findMatchingView(rendering: Rendering, { lookAt_deg, pitch_deg }: Frame): View | undefined {
  return [...rendering.views.values()].find(({ frame }) => frame.lookAt_deg === lookAt_deg && frame.pitch_deg === pitch_deg);
}

/** Explains why two renderings cannot share a map; null when they can. Origins, squares and resolutions may differ. */
export function findIncompatibility(first: Rendering, other: Rendering): string | null {
  const [a, b] = [first.json, other.json];
  if (!isSameCrs(a.crs, b.crs)) return `its CRS is "${formatCrs(b.crs)}", but the map's is "${formatCrs(a.crs)}"`;
  if (a.crs.vertical && b.crs.vertical && a.crs.vertical !== b.crs.vertical)
    return `its heights are ${b.crs.vertical}, but the map's are ${a.crs.vertical}`;
  if ([...first.views.values()].some(({ frame }) => findMatchingView(other, frame))) return null;
  return `it has none of the map's views: it has ${[...other.views.keys()].join(", ")}, the map has ${[...first.views.keys()].join(", ")}`;
}

type Crs = ManifestJson["crs"];

function isSameCrs(a: Crs, b: Crs): boolean {
  if (a.epsg !== null && b.epsg !== null) return a.epsg === b.epsg;
  return a.wkt !== null && b.wkt !== null ? a.wkt === b.wkt : a.epsg === b.epsg && a.name === b.name;
}

const formatCrs = ({ epsg, name }: Crs): string => (epsg === null ? name : `EPSG:${String(epsg)} ${name}`);

import type { Frame } from "../geo/frame";
import type { ManifestJson, Rendering, View } from "../geo/manifest";

/** The view of a rendering that looks as a frame does, whatever its id. */
export function findMatchingView(rendering: Rendering, { lookAtDeg, pitchDeg }: Frame): View | undefined {
  return [...rendering.views.values()].find(({ frame }) => frame.lookAtDeg === lookAtDeg && frame.pitchDeg === pitchDeg);
}

/** Why a rendering cannot be shown with another that is on the map: none when it can. Origins, squares and resolutions may differ. */
export function findIncompatibility(first: Rendering, other: Rendering): string | null {
  const [a, b] = [first.json, other.json];
  if (!isSameCrs(a.crs, b.crs)) return `it has the CRS "${formatCrs(b.crs)}", the map has "${formatCrs(a.crs)}"`;
  if (a.crs.vertical && b.crs.vertical && a.crs.vertical !== b.crs.vertical) return `its heights are ${b.crs.vertical}, those of the map ${a.crs.vertical}`;
  if ([...first.views.values()].some(({ frame }) => findMatchingView(other, frame))) return null;
  return `it has no direction of the map: ${[...other.views.keys()].join(", ")} for ${[...first.views.keys()].join(", ")}`;
}

type Crs = ManifestJson["crs"];

function isSameCrs(a: Crs, b: Crs): boolean {
  if (a.epsg !== null && b.epsg !== null) return a.epsg === b.epsg;
  return a.wkt !== null && b.wkt !== null ? a.wkt === b.wkt : a.epsg === b.epsg && a.name === b.name;
}

const formatCrs = ({ epsg, name }: Crs): string => (epsg === null ? name : `EPSG:${String(epsg)} ${name}`);

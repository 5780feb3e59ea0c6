import type { LayerKind, Vec3 } from "../map3d";
import type { ProjectionParameter } from "./capabilities";
import type { TileCamera } from "./grid";
import type { RequestedImage } from "./imageFormats";
import type { SunDirection } from "./options";
import { PortrayalError } from "./portrayalError";

/** What all views of a layer have in common. */
export interface ViewTemplate {
  readonly endpoint: string;
  readonly crs: string;
  readonly northFirst: boolean;
  readonly layers: readonly string[];
  readonly styles: readonly string[];
  readonly side_px: number;
  /** Quality of colours, 0 to 100; undefined for the service's. */
  readonly colorQuality?: number | undefined;
  /** Sun of the image layer SUN. */
  readonly sun?: SunDirection | undefined;
  /** null: the order of the standard. */
  readonly projection: readonly ProjectionParameter[] | null;
}

/** The order of OGC 15-001r4 Table 40. */
const STANDARD: readonly ProjectionParameter[] = ["poc", "poi", "up", "left", "right", "bottom", "top", "nearplane", "farplane"].map(
  (name) => ({ name, required: name === "poc" || name === "poi" }),
);
/** Distance of the near plane, metres: some renderers refuse 0. The content is much farther. */
const NEAR_M = 1;
const DECIMALS = 9;
const BEST_QUALITY = 100;

/** Writes a number without an exponent. */
export const formatNumber = (value: number): string =>
  value
    .toFixed(DECIMALS)
    .replace(/\.?0+$/, "")
    .replace(/^-0$/, "0");

/** Appends parameters to a URL that may have some. Their names and values must be encoded. */
export function withQuery(endpoint: string, query: string): string {
  const [base = ""] = endpoint.split("#");
  return base + (!base.includes("?") ? "?" : /[?&]$/.test(base) ? "" : "&") + query;
}

const list = (items: readonly string[]): string => items.map(encodeURIComponent).join(",");

/** Returns the GetView request of a tile (OGC 15-001r4 §10.7.1). */
export function viewUrl(template: ViewTemplate, camera: TileCamera, images: readonly RequestedImage[]): string {
  const { endpoint, crs, layers, styles, side_px, colorQuality, sun } = template;
  const has = (wanted: LayerKind): boolean => images.some(({ kind }) => kind === wanted);
  const side = String(side_px);
  const projection = ["Orthographic", ...projectionValues(template, camera)].join(",");
  const portrayal = `WIDTH=${side};HEIGHT=${side};PROJECTION=${projection};IMAGELAYERS=${list(images.map(({ identifier }) => identifier))};FORMATS=${list(images.map(({ format }) => format))}`;
  // One value for each image; those of exact formats have no effect.
  const qualities =
    colorQuality !== undefined && has("color")
      ? `;QUALITIES=${images.map(({ kind }) => String(kind === "color" ? colorQuality : BEST_QUALITY)).join(",")}`
      : "";
  const parameters = [
    "service=3DPS&request=GetView&version=1.0",
    `crs=${encodeURIComponent(crs)}`,
    `layers=${list(layers)}`,
    ...(styles.length > 0 ? [`styles=${list(styles)}`] : []),
    ...(has("color") ? ["transparentBackground=true"] : []),
    ...(sun && has("sun") ? [`sun=${formatNumber(sun.azimuth_deg)},${formatNumber(sun.elevation_deg)}`] : []),
    `portrayals=${portrayal}${qualities}`,
  ];
  return withQuery(endpoint, parameters.join("&"));
}

/** Returns the values of the projection in the service's order; optional parameters that are not known are empty. @throws PortrayalError */
function projectionValues({ projection, northFirst, endpoint }: ViewTemplate, camera: TileCamera): string[] {
  const ordered = projection ?? STANDARD;
  const turn = ([x, y, z]: Vec3): Vec3 => (northFirst ? [y, x, z] : [x, y, z]);
  // UP may be left out where the service says so: the standard's text means a position by it, its examples a direction.
  const upOptional = ordered.every(({ name, required }) => !name.startsWith("up") || !required);
  const positions = new Map<string, Vec3 | null>([
    ["poc", turn(camera.position)],
    ["poi", turn(camera.target)],
    ["up", camera.straightDown ? turn(camera.up) : upOptional ? null : [0, 0, 1]],
  ]);
  const half = camera.half_m;
  const numbers = new Map(
    Object.entries({
      left: -half,
      right: half,
      bottom: -half,
      top: half,
      nearplane: NEAR_M,
      near: NEAR_M,
      farplane: camera.far_m,
      far: camera.far_m,
    }),
  );
  return ordered.flatMap(({ name, required }) => {
    const [, group = "", axis = ""] = /^(poc|poi|up)x?([1-3]?)$/.exec(name) ?? [];
    const position = positions.get(group);
    if (position !== undefined)
      return axis === ""
        ? (position?.map(formatNumber) ?? ["", "", ""])
        : [position ? formatNumber(position[Number(axis) - 1] as number) : ""];
    const number = numbers.get(name);
    if (number === undefined && required)
      throw new PortrayalError(`${endpoint}: the orthographic projection requires the parameter "${name}", which map3d does not know`);
    return [number === undefined ? "" : formatNumber(number)];
  });
}

/** Returns the GetFeatureInfoByObjectId request of an object (OGC 15-001r4 §11.6). */
export function objectUrl(endpoint: string, layers: readonly string[], id: number, format: string): string {
  return withQuery(
    endpoint,
    `service=3DPS&request=GetFeatureInfoByObjectId&version=1.0&layers=${list(layers)}&objectId=${String(id)}&format=${encodeURIComponent(format)}`,
  );
}

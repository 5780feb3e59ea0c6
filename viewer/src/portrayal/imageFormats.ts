import { towardsLight } from "../geo/light";
import { UsageError, type LayerInfo, type LayerKind } from "../map3d";
import type { Capabilities, OfferedImageLayer } from "./capabilities";
import { DEPTH_UNIT_M } from "./decodeData";
import type { PortrayalOptions, SunDirection } from "./options";

/** A layer of the map, and the image layer and format that it is requested as. */
export interface RequestedImage {
  readonly kind: LayerKind;
  /** Name of the image layer in requests. */
  readonly identifier: string;
  /** Parameterised media type as the service advertises it. */
  readonly format: string;
  /** The media type alone. */
  readonly mediaType: string;
}

/** Kinds of layers, and their image layers (OGC 15-001r4 Table 35). */
export const IMAGE_LAYERS = { color: "COLOR", normal: "NORMAL", id: "OBJECTID", depth: "DEPTH" } as const;
/** Kinds of layers that are requested on demand, and the additional image layers of map3d servers. */
const ADDITIONAL_LAYERS = { ao: "AO", sun: "SUN" } as const;
type RequestedKind = keyof typeof IMAGE_LAYERS | keyof typeof ADDITIONAL_LAYERS;

/** Accepted formats, best first. Data layers must be exact: PNG, for floats with 32 bits. Colours are exact by default, too, and transparent where nothing is. */
const PREFERRED: Readonly<Record<RequestedKind, readonly string[]>> = {
  color: ["image/png;mode=32bit", "image/png", "image/webp", "image/png;mode=24bit", "image/jpeg", "image/jpg"],
  normal: ["image/png;mode=24bit;encoding=rgb", "image/png;mode=24bit", "image/png", "image/png;mode=32bit"],
  id: ["image/png;mode=32bit", "image/png", "image/png;mode=24bit"],
  depth: ["image/png;mode=32bit", "image/png"],
  ao: ["image/png"],
  sun: ["image/png"],
};
/** Formats that have a quality. */
const LOSSY: readonly string[] = ["image/jpeg", "image/webp"];

const normalize = (format: string): string => format.toLowerCase().replace(/\s+/g, "");
export const mediaTypeOf = (format: string): string => (normalize(format).split(";")[0] ?? "").replace("image/jpg", "image/jpeg");
/** Has the format the order x, y, z in R, G, B, instead of the standard's B, G, R? */
export const isRgbOrder = (format: string): boolean => normalize(format).includes("encoding=rgb");

/** Chooses the format of each kind of layer that the service offers. @param colorFormat replaces the preferred formats of colours */
export function chooseImages({ imageLayers }: Capabilities, colorFormat?: string): ReadonlyMap<LayerKind, RequestedImage> {
  const found = new Map<LayerKind, RequestedImage>();
  for (const [kind, name] of Object.entries(IMAGE_LAYERS) as [RequestedKind, string][]) {
    const image = chooseImage(
      imageLayers.get(name),
      kind,
      kind === "color" && colorFormat !== undefined ? [normalize(colorFormat)] : PREFERRED[kind],
    );
    if (image) found.set(kind, image);
  }
  return found;
}

/** Returns the additional images that the options ask for. @throws UsageError if the service does not advertise them or their parameter */
export function chooseAdditionalImages(
  { imageLayers, operations }: Capabilities,
  { occlusion = false, sun }: PortrayalOptions,
  url: string,
): RequestedImage[] {
  const view = operations.get("GetView");
  const wanted: [boolean, keyof typeof ADDITIONAL_LAYERS, string][] = [
    [occlusion, "ao", "occlusion"],
    [sun !== undefined, "sun", "sun"],
  ];
  return wanted
    .filter(([isWanted]) => isWanted)
    .map(([, kind, option]) => {
      const name = ADDITIONAL_LAYERS[kind];
      const offered = imageLayers.get(name);
      if (!offered)
        throw new UsageError(`${option}: ${url} does not advertise the image layer ${name}; it has ${[...imageLayers.keys()].join(", ")}`);
      const image = chooseImage(offered, kind, PREFERRED[kind]);
      if (!image)
        throw new UsageError(
          `${option}: ${url} does not advertise ${name} as ${PREFERRED[kind].join(", ")}; it has ${offered.formats.join(", ") || "no formats"}`,
        );
      if (kind === "sun" && !view?.parameters.has("sun"))
        throw new UsageError(
          `${option}: the GetView of ${url} does not advertise the parameter SUN, so that the direction of the light cannot be chosen`,
        );
      return image;
    });
}

function chooseImage(offered: OfferedImageLayer | undefined, kind: RequestedKind, wanted: readonly string[]): RequestedImage | null {
  const format = wanted.map((one) => offered?.formats.find((text) => normalize(text) === one)).find((text) => text !== undefined);
  return offered && format !== undefined ? { kind, identifier: offered.identifier, format, mediaType: mediaTypeOf(format) } : null;
}

/** Checks options that do not depend on the service. @throws UsageError */
export function checkImageOptions({ colorFormat, colorQuality, sun }: PortrayalOptions): void {
  if (colorQuality !== undefined && !(Number.isInteger(colorQuality) && colorQuality >= 0 && colorQuality <= 100))
    throw new UsageError(`colorQuality: expected a whole number from 0 to 100, got ${String(colorQuality)}`);
  if (colorQuality !== undefined && !LOSSY.includes(mediaTypeOf(colorFormat ?? "")))
    throw new UsageError(`colorQuality: needs a lossy colorFormat, ${LOSSY.join(" or ")}, got ${colorFormat ?? "none"}`);
  if (sun && !(sun.azimuth_deg >= 0 && sun.azimuth_deg <= 360 && sun.elevation_deg > 0 && sun.elevation_deg <= 90))
    throw new UsageError(
      `sun: expected azimuth_deg from 0 to 360 and elevation_deg above 0 and up to 90, got ${String(sun.azimuth_deg)} and ${String(sun.elevation_deg)}`,
    );
}

/** Describes the layers as a manifest does. */
export function describeLayers(images: ReadonlyMap<LayerKind, RequestedImage>, sun?: SunDirection): LayerInfo[] {
  return [...images.values()].map(({ kind, mediaType }) => {
    // Where nothing is, JPEGs have the service's background; the id layer masks it.
    const format =
      kind === "color" ? (mediaType !== "image/jpeg" ? mediaType.replace("image/", "") : images.has("id") ? "jpeg" : "opaque") : "png";
    return {
      name: kind,
      kind,
      format,
      media_type: mediaType,
      ...(kind === "depth" && { unit_m: DEPTH_UNIT_M }),
      ...(kind === "sun" && sun && { suns: [{ time: null, ...sun, direction: towardsLight(sun) }] }),
    };
  });
}

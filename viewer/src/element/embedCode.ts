import { UsageError, type Map3D } from "../map3d";

/** Options of `embedCode`. */
export interface EmbedOptions {
  /** Folder of the rendering, as the other page reaches it; also that of the scripts. */
  readonly src: string;
  /** Accessible name of the map. Default: none. */
  readonly label?: string;
}

/** Returns the lines of HTML that show a map's present view and light in another page. @throws UsageError without a view or a folder */
export function embedCode(map: Map3D, { src, label }: EmbedOptions): string {
  const { center, light, time } = map;
  if (!center) throw new UsageError('embedCode: the map has no view yet; call it after "ready"');
  if (typeof src !== "string" || src === "")
    throw new UsageError('embedCode: expected { src }, the folder of the rendering, such as "https://maps.example.org/town"');
  const folder = src.replace(/\/+$/, "");
  const view = { direction: map.direction, center: center.map((part) => part.toFixed(1)).join(" "), zoom: map.zoom.toFixed(2) };
  const sun = time
    ? { time: time.toISOString().replace(/:\d\d\.\d+Z$/, "Z") }
    : { light: `${light.azimuth_deg.toFixed(1)} ${light.elevation_deg.toFixed(1)}` };
  const attributes = Object.entries({ src: folder, ...(label !== undefined && { label }), ...view, ...sun });
  const tag = `<map-3d${attributes.map(([name, value]) => ` ${name}="${escape(value)}"`).join("")}></map-3d>`;
  return [tag, ...["map3d.js", "map3d-element.js"].map((file) => `<script src="${escape(`${folder}/${file}`)}"></script>`), ""].join("\n");
}

const escape = (text: string): string => text.replaceAll("&", "&amp;").replaceAll('"', "&quot;").replaceAll("<", "&lt;");

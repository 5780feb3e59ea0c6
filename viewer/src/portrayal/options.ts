import type { Box3, FetchFunction } from "../map3d";

/** The direction of a sun, as in the map's light. */
export interface SunDirection {
  /** Clockwise from grid north, 0 to 360. */
  readonly azimuth_deg: number;
  /** Above the horizon, above 0 and up to 90. */
  readonly elevation_deg: number;
}

/** Options of `portrayalSource`. */
export interface PortrayalOptions {
  /** Identifiers of the service's layers. Default: its first layer with a bounding box. */
  layers?: string | readonly string[];
  /** A style for each layer; "" for the default one. */
  styles?: readonly string[];
  /** The service's name of a projected coordinate system in metres. Default: the first one in which the layer has a bounding box. */
  crs?: string;
  /** Order of the axes of `crs`. Default: that of its EPSG code. */
  axes?: "east-north" | "north-east";
  /** Views: look-at angle (counter-clockwise from north) and pitch, such as "45-22.5". Default: those of the rendering that the layer links to, else four views at pitch 45. */
  views?: readonly string[];
  /** Metres per pixel at the deepest level. Default: that of the rendering that the layer links to, else 0.1. */
  resolution_m?: number;
  /** Easting, northing and height of the content's corners. Default: the layer's bounding box, which may lack heights. */
  box?: Box3;
  /** Name of one of the renderings that the layer links to, or false for none. Default: the first one, unless `views`, `resolution_m` or `box` are given. */
  rendering?: string | false;
  /** Format of colours, as the service advertises it: "image/webp" or "image/jpeg" for fewer bytes. Default: PNG. */
  colorFormat?: string;
  /** Quality of colours, 0 to 100, for a lossy `colorFormat`. Default: the service's. */
  colorQuality?: number;
  /** Requests the image layer AO, ambient occlusion, which dims the light of the sky. The service must advertise it. Default false. */
  occlusion?: boolean;
  /** Requests the image layer SUN: shadows of the sun in this direction, which are drawn while the map's light comes from there. The service must advertise it and the parameter SUN. Default: none. */
  sun?: SunDirection;
  /** Requests several images of a tile at once. Default: if the service can answer that. */
  multipart?: boolean;
  /** Attribution text. Default: that of the rendering, or the service's provider. */
  attribution?: string;
  /** Replaces the browser's fetch, for example to send credentials. Default: the browser's. */
  fetch?: FetchFunction;
}

/** Default options of a layer without a rendering. */
export const DEFAULT_VIEWS: readonly string[] = ["0-45", "90-45", "180-45", "270-45"];
export const DEFAULT_RESOLUTION_M = 0.1;
export const TILE_PX = 256;

import type { DataKind } from "../core/dataTile";
import { ManifestError } from "../core/errors";
import type { Box3, Vec3 } from "../core/vec";
import type { GeographicJson } from "./geographic";
import { DEEPEST_LEVEL, blockRoot, makeFrame, tileName, type Frame, type FrameJson, type Tile } from "./frame";
import { Occupancy } from "./occupancy";

/** A layer listed in the manifest, such as colour. */
export interface LayerInfo {
  readonly name: string;
  readonly kind: string;
  readonly format: string;
  readonly media_type: string;
  readonly unit_m?: number;
  /** Only for sun, sun16 and picture. */
  readonly suns?: readonly SunJson[];
  readonly radius_m?: number;
}

/** A sun position for which a layer was rendered. */
export interface SunJson {
  /** ISO 8601 in UTC; null when the sun was given by angles. */
  readonly time: string | null;
  /** Clockwise from true north; from grid north for an image layer of a 3D Portrayal Service. */
  readonly azimuth_deg: number;
  readonly elevation_deg: number;
  /** Unit vector towards the sun, local axes. */
  readonly direction: Vec3;
}

interface BlockVersions {
  version: number;
  versions?: Record<string, number>;
}

/** Layers that were added later, with their own block versions. */
interface PassJson extends BlockVersions {
  layers: string[];
}

/** A picture of a view in a few hundred bytes: spec/manifest.md. */
interface ThumbnailJson {
  /** Left, top, width and height of the part of the view that it shows, pixels of level 0. */
  window: number[];
  /** A WebP image in base64. */
  webp: string;
}

interface ViewJson extends FrameJson, BlockVersions {
  occupancy: string;
  passes?: PassJson[];
  archives?: Record<string, string>;
  /** Not checked here: a malformed one is not shown. */
  thumbnail?: ThumbnailJson | null;
}

/** The content of rendering.json: spec/manifest.md. */
export interface ManifestJson {
  map3d: string;
  version: number;
  /** Last segment of the base URL. */
  name: string;
  title: string;
  attribution: string;
  /** Increases with every change of the content. */
  content_version: number;
  archive_part_bytes?: number;
  /** Whether all tiles have been rendered. */
  complete: boolean;
  crs: {
    epsg: number | null;
    wkt: string | null;
    name: string;
    vertical: string | null;
    /** What heights refer to; absent in older manifests. */
    heights?: "geoid" | "ellipsoid" | "unknown";
    vertical_epsg?: number | null;
  };
  /** Position on earth; absent when unknown. */
  geographic?: GeographicJson;
  /** World coordinates of the local origin, metres. */
  origin: Vec3;
  /** Bounding box of the content, local. */
  box: Box3;
  /** `view`: the view that is shown first; without it, the first of `views`. `radius_m`: of a circle around the start with some objects. */
  start?: { local: Vec3; view?: string; radius_m?: number };
  tile_px: number;
  /** Deepest level. */
  zmax: number;
  /** Side length of the tile of level 0. */
  size_m: number;
  layers: LayerInfo[];
  views: ViewJson[];
  /** `box`: of all objects but the ground, local. */
  objects?: { count: number; box?: Box3; shard_size: number; shards: string; search?: string; attributes?: string; columns?: string };
}

/** A view of a rendering: its frame, its occupied tiles and the versions of its blocks. */
export interface View {
  readonly id: string;
  readonly frame: Frame;
  readonly occupancy: Pick<Occupancy, "has">;
  readonly archives: Readonly<Record<string, string>> | undefined;
  /** Size of the files in which archives are divided; undefined for whole archives. */
  readonly part_bytes: number | undefined;
  /** Returns the version of the block that holds a layer's tile. */
  versionOf(tile: Tile, layer: LayerInfo): number;
}

/** A checked manifest. */
export interface Rendering {
  readonly json: ManifestJson;
  readonly views: ReadonlyMap<string, View>;
  /** The first layer of each kind; a layer of data tiles counts as one of normals, one of ids and one of depths. */
  readonly layers: ReadonlyMap<string, LayerInfo>;
}

const SUPPORTED_VERSION = 1;
/** The kinds that a layer of data tiles (spec/data-tile.md) stands for. */
export const DATA_KINDS: readonly DataKind[] = ["normal", "id", "depth"];
/** The kinds of rendered light. */
export const LIGHT_KINDS: readonly string[] = ["sun", "sun16", "ao"];

/** Checks a parsed manifest. @throws ManifestError with the file, what was expected and what it contains */
export function readManifest(value: unknown, where: string): Rendering {
  const json = checkManifest(value, where);
  const views = new Map(json.views.map((view) => [view.id, makeView(view, json)]));
  const layers = new Map(
    json.layers
      .flatMap((layer) => (layer.kind === "data" ? DATA_KINDS.map((kind) => ({ ...layer, kind })) : [layer]))
      .reverse()
      .map((layer) => [layer.kind, layer]),
  );
  return { json, views, layers };
}

function makeView(view: ViewJson, json: ManifestJson): View {
  const passes = new Map(view.passes?.flatMap((pass) => pass.layers.map((name) => [name, pass] as const)));
  return {
    id: view.id,
    frame: makeFrame(view, json.size_m, json.tile_px, json.zmax),
    occupancy: new Occupancy(view.occupancy, json.zmax),
    archives: view.archives,
    part_bytes: json.archive_part_bytes,
    versionOf: (tile, layer) => {
      const { version, versions } = passes.get(layer.name) ?? view;
      return versions?.[tileName(blockRoot(tile, json.zmax))] ?? version;
    },
  };
}

function checkManifest(value: unknown, where: string): ManifestJson {
  const json = value as Partial<ManifestJson> | null;
  const fail = (why: string): never => {
    throw new ManifestError(`${where}: ${why}`);
  };
  if (!json || typeof json !== "object" || json.map3d !== "rendering")
    return fail('is not a rendering.json: "map3d": "rendering" is missing');
  if (json.version !== SUPPORTED_VERSION)
    return fail(
      `has version ${String(json.version)}, but this viewer reads version ${String(SUPPORTED_VERSION)}; use the viewer of the same release`,
    );
  const wrong = FIELDS.find(([name, ok]) => !ok(json[name]));
  if (wrong)
    return fail(
      `field "${wrong[0]}" is missing or malformed, got ${((JSON.stringify(json[wrong[0]]) as string | undefined) ?? "nothing").slice(0, 80)}`,
    );
  const full = json as ManifestJson;
  const badView = full.views.find((view) => !isView(view));
  const badPasses = full.views.find((view) => !arePasses(view.passes));
  if (badView) return fail(`view ${JSON.stringify(badView.id)} lacks a frame or occupancy`);
  if (badPasses) return fail(`view ${badPasses.id} has a pass without layers or version`);
  return full;
}

const isNumber = (v: unknown): boolean => typeof v === "number" && Number.isFinite(v);
const isPoint = (v: unknown): boolean => Array.isArray(v) && v.length === 3 && v.every(isNumber);
const isLevel = (v: unknown): boolean => Number.isInteger(v) && Number(v) >= 0 && Number(v) <= DEEPEST_LEVEL;

const FIELDS: [keyof ManifestJson, (v: unknown) => boolean][] = [
  ["origin", isPoint],
  ["box", (v) => Array.isArray(v) && v.length === 2 && v.every(isPoint)],
  ["tile_px", (v) => Number.isInteger(v) && Number(v) > 0 && Number(v) <= 4096],
  ["zmax", isLevel],
  ["size_m", (v) => isNumber(v) && Number(v) > 0],
  ["layers", (v) => Array.isArray(v) && v.length > 0 && v.every(isLayer)],
  ["views", (v) => Array.isArray(v) && v.length > 0],
  ["geographic", isGeographic],
];

function isLayer(value: unknown): boolean {
  const layer = value as Partial<LayerInfo> | null;
  return typeof layer?.name === "string" && typeof layer.kind === "string" && typeof layer.format === "string" && areSuns(layer.suns);
}

function areSuns(value: unknown): boolean {
  return value === undefined || (Array.isArray(value) && value.every((sun: Partial<SunJson> | null) => isPoint(sun?.direction)));
}

const isPair = (v: unknown): boolean => Array.isArray(v) && v.length === 2 && v.every(isNumber);
const isTerms = (v: unknown, degree: number): boolean =>
  Array.isArray(v) && v.length === ((degree + 1) * (degree + 2)) / 2 && v.every(isNumber);

function isGeographic(value: unknown): boolean {
  const geographic = value as Partial<GeographicJson> | undefined | null;
  if (geographic === undefined) return true;
  if (
    !geographic ||
    !isPair(geographic.local) ||
    !isPair(geographic.lon_lat) ||
    !(Number(geographic.unit_m) > 0) ||
    !(Number(geographic.unit_deg) > 0)
  )
    return false;
  const degree = Number(geographic.degree);
  const rows = [geographic.to, geographic.back].flatMap((pair: readonly unknown[] | undefined) =>
    Array.isArray(pair) ? ([pair[0], pair[1]] as unknown[]) : [null],
  );
  return Number.isInteger(degree) && degree >= 1 && degree <= 16 && rows.every((row) => isTerms(row, degree));
}

function arePasses(value: unknown): boolean {
  const ok = (pass: Partial<PassJson> | null): boolean => Array.isArray(pass?.layers) && isNumber(pass.version);
  return value === undefined || (Array.isArray(value) && value.every(ok));
}

function isView(view: Partial<ViewJson>): boolean {
  const numbers = [view.look_at_deg, view.pitch_deg, view.u0_m, view.v0_m, view.d0_m, view.version];
  return typeof view.id === "string" && typeof view.occupancy === "string" && numbers.every(isNumber);
}

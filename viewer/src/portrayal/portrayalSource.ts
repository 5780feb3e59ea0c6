import { sub } from "../core/vec";
import {
  readManifest,
  UsageError,
  type FetchFunction,
  type LayerInfo,
  type LayerKind,
  type ManifestJson,
  type Rendering,
  type Source,
  type Tile,
  type TileData,
  type View,
} from "../map3d";
import { readCapabilities, type Capabilities, type ServiceLayer } from "./capabilities";
import { DataDecoder } from "./dataDecoder";
import { readFeatureInfo } from "./featureInfo";
import { makeViews, placeCamera } from "./grid";
import {
  checkImageOptions,
  chooseAdditionalImages,
  chooseImages,
  describeLayers,
  IMAGE_LAYERS,
  isRgbOrder,
  type RequestedImage,
} from "./imageFormats";
import { pngColorType } from "./imageHeader";
import { chooseLayers, originOf, placeLayers, type LayerPlace } from "./layerPlace";
import { DEFAULT_RESOLUTION_M, DEFAULT_VIEWS, TILE_PX, type PortrayalOptions } from "./options";
import { PortrayalError } from "./portrayalError";
import { objectUrl, withQuery } from "./requestUrls";
import { fetchAnswer } from "./serviceFetch";
import { ViewRequests } from "./viewRequests";
import { parseXml } from "./xml";

/** A source whose images come from a 3D Portrayal Service. */
export interface PortrayalSource extends Source {
  /** Kinds of layers that the service does not offer in a usable format. Without `normal` there is no light, without `id` no picking, without `depth` no positions and no measuring. Empty before the manifest is read. */
  readonly missing: readonly LayerKind[];
}

/** Largest documents, bytes. */
const [MAX_CAPABILITIES, MAX_MANIFEST, MAX_INFO] = [16 << 20, 64 << 20, 1 << 20] as const;
const OBJECT = /^objects\/(\d{1,10})\.json$/;
const WITHOUT: Partial<Record<LayerKind, string>> = {
  normal: "no light",
  id: "no picking, highlights or styles",
  depth: "no positions, measuring or combination with other layers",
};

/**
 * Reads a layer of an OGC 3D Portrayal Service 1.0: one orthographic GetView per tile, in the pixel grid of the rendering that the layer links to, if it does.
 * @param url the service, such as "https://example.org/3dps"; may have parameters of its own
 * @throws UsageError for invalid options
 */
export function portrayalSource(url: string, options: PortrayalOptions = {}): PortrayalSource {
  return new ServiceSource(url, options);
}

/** What is known once the capabilities are read. */
interface OpenedLayer {
  readonly rendering: Rendering;
  readonly images: ReadonlyMap<LayerKind, RequestedImage>;
  readonly views: ViewRequests;
  readonly identifiers: readonly string[];
  /** URL of GetFeatureInfoByObjectId and its format; null if objects cannot be queried. */
  readonly info: { readonly url: string; readonly format: string } | null;
}

class ServiceSource implements PortrayalSource {
  readonly #url: string;
  readonly #options: PortrayalOptions;
  readonly #fetch: FetchFunction;
  readonly #decoder = new DataDecoder();
  #opened: Promise<OpenedLayer> | undefined;
  #missing: readonly LayerKind[] = [];

  constructor(url: string, options: PortrayalOptions) {
    const full = new URL(url, globalThis.document.baseURI);
    if (!/^https?:$/.test(full.protocol)) throw new UsageError(`a 3D Portrayal Service needs an http or https URL, got "${url}"`);
    full.hash = "";
    if (options.resolution_m !== undefined && !(options.resolution_m > 0))
      throw new UsageError(`resolution_m: expected metres per pixel above 0, got ${String(options.resolution_m)}`);
    checkImageOptions(options);
    if (options.views?.length === 0) throw new UsageError('views: expected at least one view, such as "0-45"');
    this.#url = full.href;
    this.#options = options;
    this.#fetch = options.fetch ?? ((...given) => fetch(...given));
  }

  get missing(): readonly LayerKind[] {
    return this.#missing;
  }

  async manifest(): Promise<Rendering> {
    this.#opened ??= this.#open();
    this.#opened.catch(() => {
      this.#opened = undefined;
    });
    return (await this.#opened).rendering;
  }

  async json(path: string): Promise<unknown> {
    const id = OBJECT.exec(path)?.[1];
    const { info, identifiers } = await this.#ready();
    if (id === undefined || !info) return null;
    const where = `${info.url}: GetFeatureInfoByObjectId`;
    const answer = await fetchAnswer({
      url: objectUrl(info.url, identifiers, Number(id), info.format),
      where,
      limit_bytes: MAX_INFO,
      fetch: this.#fetch,
    });
    const found = readFeatureInfo(parseXml(answer.bytes, where));
    return { map3d: "objects", version: 1, shard: Number(id), objects: found ? { [id]: found } : {} };
  }

  async tile(view: View, layer: LayerInfo, tile: Tile, signal?: AbortSignal): Promise<ArrayBuffer | TileData> {
    const { images, views, rendering } = await this.#ready();
    const image = images.get(layer.kind as LayerKind);
    if (!image) throw new PortrayalError(`${this.#url} has no image layer for "${layer.name}"`);
    const camera = placeCamera(view.frame, tile, rendering.json.origin, rendering.json.box);
    const bytes = await views.request(view, tile, camera, image, signal);
    const kind = image.kind;
    if (kind !== "normal" && kind !== "id" && kind !== "depth") return bytes;
    const rgbOrder = isRgbOrder(image.format);
    // Words of 32 bits and normals in the order R, G, B are stored as in tiles.
    if ((kind === "id" && pngColorType(bytes) === 6) || (kind === "normal" && rgbOrder && pngColorType(bytes) === 2)) return bytes;
    return this.#decoder.decode({ kind, bytes, rgbOrder, far_m: camera.far_m });
  }

  async #ready(): Promise<OpenedLayer> {
    await this.manifest();
    return this.#opened as Promise<OpenedLayer>;
  }

  async #open(): Promise<OpenedLayer> {
    const capabilities = await this.#fetchCapabilities();
    const layers = chooseLayers(capabilities, this.#options, this.#url);
    const place = placeLayers(layers, this.#options, this.#url);
    const images = this.#chooseImages(capabilities);
    const info = this.#findInfo(capabilities, layers);
    const rendering = (await this.#openLinkedRendering(layers, place)) ?? this.#makeRendering(layers, place, capabilities);
    const identifiers = layers.map(({ identifier }) => identifier);
    const template = {
      endpoint: this.#operationUrl(capabilities, "GetView") as string,
      crs: place.crs,
      northFirst: place.northFirst,
      layers: identifiers,
      styles: this.#options.styles ?? [],
      colorQuality: this.#options.colorQuality,
      sun: this.#options.sun,
      side_px: rendering.json.tile_px,
      projection: capabilities.orthographic,
    };
    const views = new ViewRequests(template, this.#fetch, this.#options.multipart ?? (capabilities.multipart ? undefined : false));
    return { rendering: this.#describe(rendering, images, info !== null), images, views, identifiers, info };
  }

  async #fetchCapabilities(): Promise<Capabilities> {
    const where = `${this.#url}: GetCapabilities`;
    const answer = await fetchAnswer({
      url: withQuery(this.#url, "service=3DPS&request=GetCapabilities&acceptVersions=1.0"),
      where,
      limit_bytes: MAX_CAPABILITIES,
      fetch: this.#fetch,
    });
    const capabilities = readCapabilities(parseXml(answer.bytes, where), where);
    if (capabilities.operations.size > 0 && !capabilities.operations.has("GetView"))
      throw new PortrayalError(`${where}: the service does not offer GetView, which images need`);
    if (capabilities.orthographic?.length === 0)
      throw new PortrayalError(`${where}: the service does not offer the orthographic projection, which tiles need`);
    return capabilities;
  }

  /** Returns the URL of an operation, by http or https as the page's user gave it; null if the service does not offer the operation. */
  #operationUrl({ operations }: Capabilities, name: string): string | null {
    const operation = operations.get(name);
    if (!operation && operations.size > 0) return null;
    const [own, full] = [new URL(this.#url), new URL(operation?.url ?? this.#url, this.#url)];
    if (full.hostname === own.hostname) full.protocol = own.protocol;
    if (!/^https?:$/.test(full.protocol))
      throw new PortrayalError(`${this.#url}: ${name} has the URL ${full.href.slice(0, 100)}, expected http or https`);
    return full.href;
  }

  #chooseImages(capabilities: Capabilities): ReadonlyMap<LayerKind, RequestedImage> {
    const { colorFormat } = this.#options;
    const images = chooseImages(capabilities, colorFormat);
    if (!images.has("color"))
      throw new (colorFormat === undefined ? PortrayalError : UsageError)(
        `${this.#url}: the service has no COLOR images as ${colorFormat ?? "PNG, JPEG or WebP"}; it has ${capabilities.imageLayers.get("COLOR")?.formats.join(", ") ?? "none"}`,
      );
    this.#missing = (Object.keys(IMAGE_LAYERS) as LayerKind[]).filter((kind) => !images.has(kind));
    if (this.#missing.length > 0)
      console.warn(
        `map3d: ${this.#url} offers no usable ${this.#missing.map((kind) => IMAGE_LAYERS[kind as keyof typeof IMAGE_LAYERS]).join(", ")} images: ${this.#missing.map((kind) => WITHOUT[kind]).join("; ")}`,
      );
    return new Map([
      ...images,
      ...chooseAdditionalImages(capabilities, this.#options, this.#url).map((image) => [image.kind, image] as const),
    ]);
  }

  #findInfo(capabilities: Capabilities, layers: readonly ServiceLayer[]): OpenedLayer["info"] {
    const operation = capabilities.operations.get("GetFeatureInfoByObjectId");
    const formats = operation?.formats ?? [];
    const format = formats.length === 0 ? "text/xml" : formats.find((one) => /^(text|application)\/xml\b/.test(one));
    const url =
      operation && format !== undefined && layers.every(({ queryable }) => queryable)
        ? this.#operationUrl(capabilities, "GetFeatureInfoByObjectId")
        : null;
    return url !== null && format !== undefined ? { url, format } : null;
  }

  /** Returns the rendering that the layer links to, for its pixel grid; null without one. @throws UsageError, PortrayalError, FetchError, ManifestError */
  async #openLinkedRendering(layers: readonly ServiceLayer[], { epsg }: LayerPlace): Promise<Rendering | null> {
    const { rendering: wanted, views, resolution_m, box } = this.#options;
    const links = layers.length === 1 ? (layers[0]?.renderings ?? []) : [];
    if (wanted === false || (wanted === undefined && (views ?? resolution_m ?? box) !== undefined)) return null;
    const link = wanted === undefined ? links[0] : links.find(([name]) => name === wanted);
    if (wanted !== undefined && !link)
      throw new UsageError(
        `${this.#url}: the layer links to no rendering "${wanted}"; it links to ${links.map(([name]) => name).join(", ") || "none"}`,
      );
    const url = link && new URL(link[1], this.#url);
    if (!url) return null;
    const own = new URL(this.#url);
    if (url.hostname === own.hostname) url.protocol = own.protocol;
    if (url.origin !== own.origin)
      throw new PortrayalError(
        `${this.#url}: the layer links to a rendering of another server, ${url.origin}; set the option rendering to false`,
      );
    const where = `${this.#url}: manifest of rendering "${link[0]}"`;
    const answer = await fetchAnswer({ url: url.href, where, limit_bytes: MAX_MANIFEST, fetch: this.#fetch });
    const found = readManifest(parseJson(answer.bytes, where), where);
    if (found.json.crs.epsg !== epsg)
      throw new PortrayalError(
        `${where}: has the coordinate system EPSG:${String(found.json.crs.epsg)}, but the layer EPSG:${String(epsg)}; set the option rendering to false`,
      );
    return found;
  }

  /** Makes a rendering of the whole box. */
  #makeRendering(layers: readonly ServiceLayer[], { crs, epsg, box }: LayerPlace, { provider }: Capabilities): Rendering {
    const { views: ids = DEFAULT_VIEWS, resolution_m = DEFAULT_RESOLUTION_M } = this.#options;
    const origin = originOf(box);
    const local = [sub(box[0], origin), sub(box[1], origin)] as const;
    const { views, size_m, zmax } = makeViews(local, ids, resolution_m, TILE_PX);
    const titles = layers.map(({ title, identifier }) => title || identifier);
    const json: ManifestJson = {
      map3d: "rendering",
      version: 1,
      name: layers.map(({ identifier }) => identifier).join(","),
      title: titles.join(", "),
      attribution: provider,
      content_version: 1,
      complete: true,
      crs: { epsg, wkt: null, name: crs, vertical: null },
      origin,
      box: local,
      tile_px: TILE_PX,
      zmax,
      size_m,
      layers: [],
      views: [],
    };
    return { json, views: new Map(views.map((view) => [view.id, view])), layers: new Map() };
  }

  /** Returns a rendering with the layers of the service instead of stored ones. */
  #describe({ json, views }: Rendering, images: ReadonlyMap<LayerKind, RequestedImage>, hasInfo: boolean): Rendering {
    const layers = describeLayers(images, this.#options.sun);
    const described: ManifestJson = { ...json, layers, attribution: this.#options.attribution ?? json.attribution };
    if (hasInfo) described.objects = { count: json.objects?.count ?? 0, shard_size: 1, shards: "objects/{shard}.json" };
    else delete described.objects;
    const tiled = [...views.values()].map((view): [string, View] => [view.id, { ...view, archives: undefined }]);
    return { json: described, views: new Map(tiled), layers: new Map(layers.map((layer) => [layer.kind, layer])) };
  }
}

function parseJson(bytes: ArrayBuffer, where: string): unknown {
  try {
    return JSON.parse(new TextDecoder().decode(bytes)) as unknown;
  } catch {
    throw new PortrayalError(`${where}: expected JSON, got ${String(bytes.byteLength)} bytes that do not parse`);
  }
}

import type { TileData } from "../../tiles/tileData";
import type { Rgb } from "../color";
import type { DrawStyles } from "../drawStyle";
import type { ShadingOptions } from "./shadingOptions";
import type { LightLayers } from "./tileLight";
import type { Mask, MaskLayers } from "./mask";
import type { ShadeMessage, ShadeRequest, ShadeResponse, TileImage, WorkerValue } from "./shadeMessages";
import { shadeTile, type TileNeighbours, type TileLayers } from "./shadeTile";
import { composeTile } from "./composeTile";

const scope = self as unknown as {
  onmessage: (event: MessageEvent<ShadeMessage>) => void;
  postMessage: (response: ShadeResponse, transfer?: Transferable[]) => void;
};

const values = new Map<string, WorkerValue>();
/** Pixels of colour tiles that have been read back. */
const pixelCache = new Map<string, Uint8ClampedArray>();

const reader = new OffscreenCanvas(64, 64).getContext("2d", { willReadFrequently: true }) as OffscreenCanvasRenderingContext2D;
const readsExactly = testReadback();

scope.onmessage = ({ data: message }) => {
  if ("put" in message) values.set(message.put, message.value);
  else if ("drop" in message) drop(message.drop);
  else answer(message);
};

/** Tests whether the browser returns the pixels that were drawn; some alter them against fingerprinting. */
function testReadback(): boolean {
  const known = new ImageData(64, 64);
  for (let k = 0; k < known.data.length; k++) known.data[k] = k % 4 === 3 ? 255 : Math.imul(k, 0x9e3779b9) >>> 24;
  reader.putImageData(known, 0, 0);
  return reader.getImageData(0, 0, 64, 64).data.every((byte, k) => byte === known.data[k]);
}

function drop(name: string): void {
  const value = values.get(name);
  if (value && "bitmap" in value) value.bitmap.close();
  values.delete(name);
  pixelCache.delete(name);
}

function answer({ ticket, options, layers, neighbours }: ShadeRequest): void {
  try {
    const picture = paint(options, layers, neighbours);
    scope.postMessage({ ticket, picture }, ["data" in picture ? picture.data.buffer : picture]);
  } catch (reason) {
    scope.postMessage({ ticket, error: String(reason) });
  }
}

function paint(options: ShadingOptions, names: ShadeRequest["layers"], neighbourNames: ShadeRequest["neighbours"]): TileImage {
  const pictured = names.color ?? names.picture;
  const color = findTile(pictured);
  const { width, height } = [color, findTile(names.normal), findTile(names.id), findTile(names.depth)].find(
    (value) => value !== undefined,
  ) ?? { width: 0, height: 0 };
  const bitmap = color && "bitmap" in color ? color.bitmap : undefined;
  const lightLayers = loadLightLayers(options, names.normal, names.ao, names[options.light?.shadow?.kind ?? "sun"]);
  const layers: TileLayers = {
    width,
    height,
    color: readsExactly && bitmap && pictured !== undefined ? readPixels(pictured, bitmap) : undefined,
    lightLayers,
    id: loadValues(names.id),
    depth: loadValues(names.depth),
  };
  const shadow = neighbourNames[options.light?.shadow?.kind ?? "sun"];
  const neighbours: TileNeighbours = {
    lightLayers: (neighbourNames.normal ?? []).map((name, k) => loadLightLayers(options, name, neighbourNames.ao?.[k], shadow?.[k])),
    id: (neighbourNames.id ?? []).map(loadValues),
    masks: options.masks.flatMap(loadMask),
  };
  const colors = options.highlight === null ? undefined : (values.get(options.highlight) as ReadonlyMap<number, Rgb> | undefined);
  const styles = options.styles === null ? undefined : (values.get(options.styles) as DrawStyles | undefined);
  if (bitmap && !readsExactly && options.mode !== "id" && options.mode !== "normal" && options.mode !== "depth")
    return composeTile(options, bitmap, layers, neighbours, { colors, styles });
  return new ImageData(shadeTile(options, layers, neighbours, { colors, styles }), width, height);
}

function loadMask(mask: Mask): MaskLayers[] {
  const [data, color] = [findTile(mask.depth), findTile(mask.color ?? undefined)];
  if (data?.kind !== "depth") return [];
  const pixels = readsExactly && mask.color !== null && color && "bitmap" in color ? readPixels(mask.color, color.bitmap) : undefined;
  return [{ mask, width: data.width, height: data.height, depth: data.values, color: pixels }];
}

function findTile(name: string | undefined): TileData | undefined {
  const value = name === undefined ? undefined : values.get(name);
  return value && "kind" in value ? value : undefined;
}

/** Collects the layers that light a tile; undefined when a required one is missing. */
function loadLightLayers(
  { light }: ShadingOptions,
  normal: string | undefined,
  ao: string | undefined,
  shadow: string | undefined,
): LightLayers | undefined {
  const [n, o, s] = [findTile(normal), light?.occlusion ? findTile(ao) : undefined, light?.shadow ? findTile(shadow) : undefined];
  if (n?.kind !== "normal" || (light?.occlusion && o?.kind !== "ao") || (light?.shadow && s?.kind !== light.shadow.kind)) return undefined;
  return {
    normal: n.values,
    ao: o?.kind === "ao" ? o.values : undefined,
    shadow: s?.kind === "sun" || s?.kind === "sun16" ? s.values : undefined,
  };
}

function loadValues(name: string | undefined): Uint32Array | undefined {
  const data = findTile(name);
  return data?.kind === "id" || data?.kind === "depth" ? data.values : undefined;
}

function readPixels(name: string, bitmap: ImageBitmap): Uint8ClampedArray {
  const known = pixelCache.get(name);
  if (known) return known;
  const { width, height } = bitmap;
  Object.assign(reader.canvas, { width, height });
  reader.drawImage(bitmap, 0, 0);
  const { data } = reader.getImageData(0, 0, width, height);
  bitmap.close();
  pixelCache.set(name, data);
  return data;
}

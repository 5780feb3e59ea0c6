import type { LayerKind } from "../../geo/manifest";
import type { TileData } from "../../tiles/tileData";
import type { Rgb } from "../drawer";
import type { DrawStyles } from "../drawStyle";
import type { Look } from "./look";
import type { Shades } from "./lightOn";
import type { Mask, Masking } from "./mask";
import type { Image } from "./pictures";
import { shade, type Around, type Layers } from "./shade";
import { composed } from "./unread";

/** What the worker keeps under a name: a tile's layer, colours of highlighted ids, or finishes. */
export type Kept = TileData | ReadonlyMap<number, Rgb> | DrawStyles;

/** A picture that is asked for; layers are named. */
export interface Order {
  readonly ticket: number;
  readonly look: Look;
  readonly layers: Partial<Record<LayerKind, string>>;
  /** To the left, to the right, above, below. */
  readonly beside: Partial<Record<LayerKind, readonly string[]>>;
}

export type Task = { readonly put: string; readonly value: Kept } | { readonly drop: string } | Order;

export type Reply =
  /** Once: can pixels of pictures be read as they are? */
  | { readonly exact: boolean }
  | { readonly ticket: number; readonly picture: Image }
  | { readonly ticket: number; readonly error: string };

const scope = self as unknown as { onmessage: (event: MessageEvent<Task>) => void; postMessage: (reply: Reply, transfer?: Transferable[]) => void };

const kept = new Map<string, Kept>();
/** Pixels of the colour tiles, once they have been read. */
const read = new Map<string, Uint8ClampedArray>();

const reader = new OffscreenCanvas(64, 64).getContext("2d", { willReadFrequently: true }) as OffscreenCanvasRenderingContext2D;
const exact = readsExactly();
scope.postMessage({ exact });

scope.onmessage = ({ data: task }) => {
  if ("put" in task) kept.set(task.put, task.value);
  else if ("drop" in task) drop(task.drop);
  else fill(task);
};

/** Some browsers answer with other pixels than were drawn, so that users cannot be told apart. */
function readsExactly(): boolean {
  const known = new ImageData(64, 64);
  for (let k = 0; k < known.data.length; k++) known.data[k] = k % 4 === 3 ? 255 : Math.imul(k, 0x9e3779b9) >>> 24;
  reader.putImageData(known, 0, 0);
  return reader.getImageData(0, 0, 64, 64).data.every((byte, k) => byte === known.data[k]);
}

function drop(name: string): void {
  const value = kept.get(name);
  if (value && "bitmap" in value) value.bitmap.close();
  kept.delete(name);
  read.delete(name);
}

function fill({ ticket, look, layers, beside }: Order): void {
  try {
    const picture = paint(look, layers, beside);
    scope.postMessage({ ticket, picture }, ["data" in picture ? picture.data.buffer : picture]);
  } catch (reason) {
    scope.postMessage({ ticket, error: String(reason) });
  }
}

function paint(look: Look, names: Order["layers"], beside: Order["beside"]): Image {
  const pictured = names.color ?? names.picture;
  const color = tile(pictured);
  const { width, height } = [color, tile(names.normal), tile(names.id), tile(names.depth)].find((value) => value !== undefined) ?? { width: 0, height: 0 };
  const bitmap = color && "bitmap" in color ? color.bitmap : undefined;
  const shades = shadesOf(look, names.normal, names.ao, names[look.light?.shadow?.kind ?? "sun"]);
  const layers: Layers = {
    width,
    height,
    color: exact && bitmap && pictured !== undefined ? pixelsOf(pictured, bitmap) : undefined,
    shades,
    id: words(names.id),
    depth: words(names.depth),
  };
  const shadow = beside[look.light?.shadow?.kind ?? "sun"];
  const around: Around = { shades: (beside.normal ?? []).map((name, k) => shadesOf(look, name, beside.ao?.[k], shadow?.[k])), id: (beside.id ?? []).map(words), masks: look.masks.flatMap(maskingOf) };
  const colors = look.highlight === null ? undefined : (kept.get(look.highlight) as ReadonlyMap<number, Rgb> | undefined);
  const finishes = look.finish === null ? undefined : (kept.get(look.finish) as DrawStyles | undefined);
  if (bitmap && !exact && look.mode !== "id" && look.mode !== "normal" && look.mode !== "depth") return composed(look, bitmap, layers, around, { colors, finishes });
  return new ImageData(shade(look, layers, around, { colors, finishes }), width, height);
}

function maskingOf(mask: Mask): Masking[] {
  const [data, color] = [tile(mask.depth), tile(mask.color ?? undefined)];
  if (data?.kind !== "depth") return [];
  const pixels = exact && mask.color !== null && color && "bitmap" in color ? pixelsOf(mask.color, color.bitmap) : undefined;
  return [{ mask, width: data.width, height: data.height, depth: data.values, color: pixels }];
}

function tile(name: string | undefined): TileData | undefined {
  const value = name === undefined ? undefined : kept.get(name);
  return value && "kind" in value ? value : undefined;
}

/** What the light of a tile depends on; none when a part that the look asks for is not here. */
function shadesOf({ light }: Look, normal: string | undefined, ao: string | undefined, shadow: string | undefined): Shades | undefined {
  const [n, o, s] = [tile(normal), light?.occlusion ? tile(ao) : undefined, light?.shadow ? tile(shadow) : undefined];
  if (n?.kind !== "normal" || (light?.occlusion && o?.kind !== "ao") || (light?.shadow && s?.kind !== light.shadow.kind)) return undefined;
  return { normal: n.values, ao: o?.kind === "ao" ? o.values : undefined, shadow: s?.kind === "sun" || s?.kind === "sun16" ? s.values : undefined };
}

function words(name: string | undefined): Uint32Array | undefined {
  const data = tile(name);
  return data?.kind === "id" || data?.kind === "depth" ? data.values : undefined;
}

function pixelsOf(name: string, bitmap: ImageBitmap): Uint8ClampedArray {
  const known = read.get(name);
  if (known) return known;
  const { width, height } = bitmap;
  Object.assign(reader.canvas, { width, height });
  reader.drawImage(bitmap, 0, 0);
  const { data } = reader.getImageData(0, 0, width, height);
  bitmap.close();
  read.set(name, data);
  return data;
}

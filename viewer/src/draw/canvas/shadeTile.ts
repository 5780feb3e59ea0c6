import type { Rgb } from "../color";
import { packStyle, TINT_OPACITY, DIM_GREY, type DrawStyles } from "../drawStyle";
import type { ShadingOptions, TileLight } from "./shadingOptions";
import { computeTileLight, type LightLayers } from "./tileLight";
import { forEachHidden, type MaskLayers } from "./mask";

/** A tile's layers; pixels by rows from the top. */
export interface TileLayers {
  readonly width: number;
  readonly height: number;
  /** RGBA, straight alpha. */
  readonly color?: Uint8ClampedArray | undefined;
  readonly lightLayers?: LightLayers | undefined;
  readonly id?: Uint32Array | undefined;
  readonly depth?: Uint32Array | undefined;
}

/** Values of the tiles to the left, to the right, above and below, where loaded. */
export type Neighbours<T> = readonly (T | undefined)[];

export interface TileNeighbours {
  readonly lightLayers: Neighbours<LightLayers>;
  readonly id: Neighbours<Uint32Array>;
  /** Tiles of other layers that may hide this one's pixels. */
  readonly masks: readonly MaskLayers[];
}

/** Highlight colours and styles of objects. */
export interface StylesById {
  readonly colors: ReadonlyMap<number, Rgb> | undefined;
  readonly styles: DrawStyles | undefined;
}

type Bytes = Uint8ClampedArray<ArrayBuffer>;

/** Shades a tile to RGBA with straight alpha, like the WebGL drawer's fragment shader at the centre of each tile pixel. */
export function shadeTile(options: ShadingOptions, layers: TileLayers, neighbours: TileNeighbours, { colors, styles }: StylesById): Bytes {
  const out: Bytes = new Uint8ClampedArray(layers.width * layers.height * 4);
  if (options.mode === "normal") paintNormals(out, layers);
  else if (options.mode === "id") paintIds(out, layers);
  else if (options.mode === "depth") paintDepths(out, layers, options.depthRange ?? [0, 1]);
  else paintColors(out, options, layers, neighbours, styles);
  if (colors && layers.id) paintHighlights(out, options, layers, neighbours, colors);
  if (layers.depth) forEachHidden(layers.width, layers.height, layers.depth, neighbours.masks, (at) => (out[4 * at + 3] = 0));
  return out;
}

/** Linear light of an sRGB byte, 0..65535. */
const LINEAR = Float32Array.from({ length: 256 }, (_, byte) => 65535 * toLinear(byte / 255));
/** sRGB byte of linear light, 0..65535. */
const BYTE = Uint8ClampedArray.from({ length: 65536 }, (_, light) => 255 * toSrgb(light / 65535));

function toLinear(c: number): number {
  return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
}

function toSrgb(c: number): number {
  return c <= 0.0031308 ? c * 12.92 : 1.055 * c ** (1 / 2.4) - 0.055;
}

function paintColors(
  out: Bytes,
  options: ShadingOptions,
  layers: TileLayers,
  neighbours: TileNeighbours,
  styles: DrawStyles | undefined,
): void {
  const { color = out, id } = layers;
  out.set(color);
  for (let at = 0; options.masked && id && at < id.length; at++) out[4 * at + 3] = id[at] === 0 ? 0 : 255;
  if (styles && id) applyStyles(out, id, styles);
  if (!options.light || !layers.lightLayers) return;
  const shares = computeTileLight(options.light, layers.width, layers.height, layers.lightLayers, neighbours.lightLayers);
  const [red, green, blue] = ([0, 1, 2] as const).map((channel) => makeLightMixer(options.light as TileLight, channel)) as [
    LightMixer,
    LightMixer,
    LightMixer,
  ];
  for (let at = 0, k = 0; at < shares.length; at += 2, k += 4) {
    const [sky, sun] = [shares[at] as number, shares[at + 1] as number];
    out[k] = lightByte(out[k] as number, red(sky, sun));
    out[k + 1] = lightByte(out[k + 1] as number, green(sky, sun));
    out[k + 2] = lightByte(out[k + 2] as number, blue(sky, sun));
  }
}

/** Applies styles like the shader's `applyStyle`. */
function applyStyles(out: Bytes, id: Uint32Array, styles: DrawStyles): void {
  forEachStyled(id, styles, (at, word) => {
    const k = 4 * at;
    const kind = word >>> 24;
    if (kind === 4) out[k + 3] = 0;
    const grey =
      kind === 3
        ? (0.2126 * (out[k] as number) + 0.7152 * (out[k + 1] as number) + 0.0722 * (out[k + 2] as number)) * (1 - DIM_GREY[1]) +
          255 * DIM_GREY[0] * DIM_GREY[1]
        : 0;
    for (let c = 0; c < 3 && (kind === 1 || kind === 3); c++) {
      const own = out[k + c] as number;
      out[k + c] = kind === 3 ? grey : own + (((word >> (8 * c)) & 255) - own) * TINT_OPACITY;
    }
  });
}

/** Calls `act` with the index and packed style of each pixel whose object is not plain. */
export function forEachStyled(id: Uint32Array, { byId, others }: DrawStyles, act: (at: number, word: number) => void): void {
  let [last, word] = [0, 0];
  for (let at = 0; at < id.length; at++) {
    const own = id[at] as number;
    if (own !== last) [last, word] = [own, own === 0 ? 0 : packStyle(byId.get(own) ?? others)];
    if (own !== 0 && word >>> 24 !== 2) act(at, word);
  }
}

type LightMixer = (sky: number, sun: number) => number;

/** Returns a function that mixes skylight and sunlight in a channel. */
export function makeLightMixer({ sky, beam }: TileLight, channel: 0 | 1 | 2): LightMixer {
  const [skylight, sunlight] = [sky[channel], beam[channel]];
  return (skyShare, sunShare) => skylight * skyShare + sunlight * sunShare;
}

function lightByte(byte: number, strength: number): number {
  const light = (LINEAR[byte] as number) * strength + 0.5;
  return BYTE[light < 65535 ? light | 0 : 65535] as number;
}

function paintNormals(out: Bytes, { lightLayers }: TileLayers): void {
  const normal = lightLayers?.normal;
  for (let k = 0, from = 0; normal && k < out.length; k += 4, from += 3) {
    const [r, g, b] = [normal[from] as number, normal[from + 1] as number, normal[from + 2] as number];
    out[k] = r;
    out[k + 1] = g;
    out[k + 2] = b;
    out[k + 3] = (r | g | b) === 0 ? 0 : 255;
  }
}

function paintIds(out: Bytes, { id }: TileLayers): void {
  const words = new Uint32Array(out.buffer);
  let [last, word] = [0, 0];
  for (let at = 0; id && at < words.length; at++) {
    const own = id[at] as number;
    if (own !== last) [last, word] = [own, own === 0 ? 0 : packRgba(computeIdColor(own))];
    words[at] = word;
  }
}

/** Computes a pale colour, always the same for an id. */
export function computeIdColor(id: number): Rgb {
  const h = Math.imul(id, 0x9e3779b9) >>> 0;
  const grey = 0.5 + (0.4 * ((h >>> 12) & 1023)) / 1023;
  const hue = (shift: number): number => 0.5 + 0.5 * Math.cos(6.2831853 * ((h >>> 22) / 1024 + shift));
  return [grey + (hue(0) - grey) * 0.34, grey + (hue(0.33) - grey) * 0.34, grey + (hue(0.67) - grey) * 0.34];
}

const NEAR: Rgb = [0.99, 0.91, 0.7];
const MIDDLE: Rgb = [0.36, 0.62, 0.62];
const FAR: Rgb = [0.16, 0.18, 0.36];

function paintDepths(out: Bytes, { depth }: TileLayers, [first, last]: readonly [number, number]): void {
  for (let at = 0, k = 0; depth && at < depth.length; at++, k += 4) {
    const d = depth[at] as number;
    if (d === 0xffffffff) continue;
    const t = 2 * Math.min(Math.max((d - first) / (last - first), 0), 1);
    const [from, to] = t < 1 ? [NEAR, MIDDLE] : [MIDDLE, FAR];
    const part = t < 1 ? t : t - 1;
    out[k] = 255 * (from[0] + (to[0] - from[0]) * part);
    out[k + 1] = 255 * (from[1] + (to[1] - from[1]) * part);
    out[k + 2] = 255 * (from[2] + (to[2] - from[2]) * part);
    out[k + 3] = 255;
  }
}

function paintHighlights(
  out: Bytes,
  options: ShadingOptions,
  layers: TileLayers,
  neighbours: TileNeighbours,
  colors: ReadonlyMap<number, Rgb>,
): void {
  forEachHighlighted(options, layers, neighbours, colors, (at, tint, rim) => {
    const k = 4 * at;
    const [r, g, b] = out[k + 3] === 0 ? [0, 0, 0] : [out[k] as number, out[k + 1] as number, out[k + 2] as number];
    const grey = (0.2126 * r + 0.7152 * g + 0.0722 * b) / 255;
    const body = (own: number, part: number): number => own * 0.28 + 255 * part * (0.5 + 0.65 * grey) * 0.72;
    out[k] = rim ? 255 * tint[0] : body(r, tint[0]);
    out[k + 1] = rim ? 255 * tint[1] : body(g, tint[1]);
    out[k + 2] = rim ? 255 * tint[2] : body(b, tint[2]);
    if (rim) out[k + 3] = Math.max(out[k + 3] as number, 0.9 * 255);
  });
}

/** Calls `act` for each highlighted pixel with its index, its colour, and whether it is near another object. */
export function forEachHighlighted(
  options: ShadingOptions,
  layers: TileLayers,
  neighbours: TileNeighbours,
  colors: ReadonlyMap<number, Rgb>,
  act: (at: number, tint: Rgb, rim: boolean) => void,
): void {
  const { width, height, id } = layers;
  if (!id) return;
  const idAt = makeIdReader(width, height, id, neighbours.id);
  const [more, less] = options.rim;
  let last = 0;
  let tint: Rgb | undefined;
  for (let y = 0, at = 0; y < height; y++) {
    for (let x = 0; x < width; x++, at++) {
      const own = id[at] as number;
      if (own === 0) continue;
      if (own !== last) [last, tint] = [own, colors.get(own)];
      if (tint)
        act(at, tint, idAt(x + more, y) !== own || idAt(x + less, y) !== own || idAt(x, y + more) !== own || idAt(x, y + less) !== own);
    }
  }
}

/** Number of pixels read beyond the edges, like the WebGL drawer's gutter. */
const GUTTER_PX = 2;

/** Returns a function that reads ids, also beyond one edge of the tile; without a neighbour there, it repeats the edge. */
function makeIdReader(
  width: number,
  height: number,
  id: Uint32Array,
  [left, right, above, below]: Neighbours<Uint32Array>,
): (x: number, y: number) => number {
  return (x, y) => {
    if (x < 0) return left ? (left[y * width + width + Math.max(x, -GUTTER_PX)] as number) : (id[y * width] as number);
    if (x >= width)
      return right ? (right[y * width + Math.min(x - width, GUTTER_PX - 1)] as number) : (id[y * width + width - 1] as number);
    if (y < 0) return above ? (above[(height + Math.max(y, -GUTTER_PX)) * width + x] as number) : (id[x] as number);
    if (y >= height)
      return below ? (below[Math.min(y - height, GUTTER_PX - 1) * width + x] as number) : (id[(height - 1) * width + x] as number);
    return id[y * width + x] as number;
  };
}

/** Packs an opaque colour as little-endian RGBA. */
export function packRgba([r, g, b]: Rgb): number {
  return (Math.round(255 * r) | (Math.round(255 * g) << 8) | (Math.round(255 * b) << 16) | (255 << 24)) >>> 0;
}

import type { Rgb } from "../color";
import { TINT_OPACITY, DIM_GREY, type DrawStyles } from "../drawStyle";
import type { ShadingOptions, TileLight } from "./shadingOptions";
import { computeTileLight } from "./tileLight";
import { forEachHidden } from "./mask";
import {
  forEachStyled,
  forEachHighlighted,
  packRgba,
  makeLightMixer,
  type TileNeighbours,
  type TileLayers,
  type StylesById,
} from "./shadeTile";

/**
 * Shades a colour tile by compositing alone, for browsers that do not return pixels exactly. Light
 * multiplies sRGB values by its 2.2nd root, which stays within a few bytes of the result in linear light.
 */
export function composeTile(
  options: ShadingOptions,
  bitmap: ImageBitmap,
  layers: TileLayers,
  neighbours: TileNeighbours,
  { colors, styles }: StylesById,
): ImageBitmap {
  const { width, height } = layers;
  const context = makeContext(width, height);
  context.drawImage(bitmap, 0, 0);
  const hidden = styles && layers.id ? applyStyles(context, layers.id, styles) : null;
  if (options.light && layers.lightLayers)
    applyLight(context, options.light, computeTileLight(options.light, width, height, layers.lightLayers, neighbours.lightLayers));
  context.globalCompositeOperation = "destination-in";
  context.drawImage(options.masked && layers.id ? makeImage(width, height, (at) => (layers.id?.[at] ? 0xff000000 : 0)) : bitmap, 0, 0);
  if (hidden) {
    context.globalCompositeOperation = "destination-out";
    context.drawImage(hidden, 0, 0);
  }
  if (colors) applyHighlights(context, options, layers, neighbours, colors);
  if (layers.depth && neighbours.masks.length > 0) {
    const behind = new Uint32Array(width * height);
    forEachHidden(width, height, layers.depth, neighbours.masks, (at) => (behind[at] = 0xff000000));
    context.globalCompositeOperation = "destination-out";
    context.drawImage(
      makeImage(width, height, (at) => behind[at] ?? 0),
      0,
      0,
    );
  }
  return context.canvas.transferToImageBitmap();
}

/** Draws tints and greys. Returns hidden pixels as an image, since alpha is not valid until the end. */
function applyStyles(context: OffscreenCanvasRenderingContext2D, id: Uint32Array, styles: DrawStyles): OffscreenCanvas {
  const { width, height } = context.canvas;
  const [paints, pale, hidden] = [new Uint32Array(id.length), new Uint32Array(id.length), new Uint32Array(id.length)];
  forEachStyled(id, styles, (at, word) => {
    const kind = word >>> 24;
    (kind === 1 ? paints : kind === 3 ? pale : hidden)[at] =
      kind === 1 ? (word | 0xff000000) >>> 0 : packRgba([DIM_GREY[0], DIM_GREY[0], DIM_GREY[0]]);
  });
  const greyCopy = makeGreyCopy(context.canvas);
  greyCopy.globalCompositeOperation = "destination-in";
  greyCopy.drawImage(
    makeImage(width, height, (at) => pale[at] ?? 0),
    0,
    0,
  );
  context.globalCompositeOperation = "source-atop";
  drawOver(context, greyCopy.canvas, 1);
  drawOver(
    context,
    makeImage(width, height, (at) => pale[at] ?? 0),
    DIM_GREY[1],
  );
  drawOver(
    context,
    makeImage(width, height, (at) => paints[at] ?? 0),
    TINT_OPACITY,
  );
  return makeImage(width, height, (at) => hidden[at] ?? 0);
}

function makeContext(width: number, height: number): OffscreenCanvasRenderingContext2D {
  return new OffscreenCanvas(width, height).getContext("2d") as OffscreenCanvasRenderingContext2D;
}

/** @param word little-endian RGBA of a pixel */
function makeImage(width: number, height: number, word: (at: number) => number): OffscreenCanvas {
  const words = Uint32Array.from({ length: width * height }, (_, at) => word(at));
  const context = makeContext(width, height);
  context.putImageData(new ImageData(new Uint8ClampedArray(words.buffer), width, height), 0, 0);
  return context.canvas;
}

/** Multiplies by light up to 1; above 1 divides by the inverse with "color-dodge". Invalidates alpha. */
function applyLight(context: OffscreenCanvasRenderingContext2D, light: TileLight, shares: Float32Array): void {
  const { width, height } = context.canvas;
  const roots = ([0, 1, 2] as const).map((channel) => {
    const strength = makeLightMixer(light, channel);
    return Float32Array.from(
      { length: width * height },
      (_, at) => strength(shares[2 * at] as number, shares[2 * at + 1] as number) ** (1 / 2.2),
    );
  });
  const wordOf = (at: number, byte: (root: number) => number): number =>
    packRgba(roots.map((root) => byte(root[at] ?? 1)) as unknown as Rgb);
  // Draws partly covered pixels over themselves until they are opaque with the same colour, as blending needs.
  context.globalCompositeOperation = "source-over";
  for (let k = 0; k < 8; k++) context.drawImage(context.canvas, 0, 0);
  context.globalCompositeOperation = "multiply";
  context.drawImage(
    makeImage(width, height, (at) => wordOf(at, (root) => Math.min(root, 1))),
    0,
    0,
  );
  if (!roots.some((channel) => channel.some((root) => root > 1))) return;
  context.globalCompositeOperation = "color-dodge";
  context.drawImage(
    makeImage(width, height, (at) => wordOf(at, (root) => Math.max(1 - 1 / root, 0))),
    0,
    0,
  );
}

/** Draws tint × (½ + 0.65 grey) over 28 % of the colour, and the opaque rim on top. */
function applyHighlights(
  context: OffscreenCanvasRenderingContext2D,
  options: ShadingOptions,
  layers: TileLayers,
  neighbours: TileNeighbours,
  colors: ReadonlyMap<number, Rgb>,
): void {
  const { width, height } = layers;
  const [bodies, rims] = [new Uint32Array(width * height), new Uint32Array(width * height)];
  forEachHighlighted(options, layers, neighbours, colors, (at, color, rim) => {
    (rim ? rims : bodies)[at] = packRgba(color);
  });
  const tints = makeImage(width, height, (at) => bodies[at] ?? 0);
  const shadows = makeGreyCopy(context.canvas);
  shadows.globalCompositeOperation = "multiply";
  shadows.drawImage(tints, 0, 0);
  const body = makeContext(width, height);
  body.globalCompositeOperation = "lighter";
  drawOver(body, shadows.canvas, 0.65);
  drawOver(body, tints, 0.5);
  body.globalCompositeOperation = "destination-in";
  drawOver(body, tints, 1);
  context.globalCompositeOperation = "source-atop";
  drawOver(context, body.canvas, 0.72);
  context.globalCompositeOperation = "source-over";
  drawOver(
    context,
    makeImage(width, height, (at) => rims[at] ?? 0),
    1,
  );
}

function makeGreyCopy(canvas: OffscreenCanvas): OffscreenCanvasRenderingContext2D {
  const context = makeContext(canvas.width, canvas.height);
  context.drawImage(canvas, 0, 0);
  context.globalCompositeOperation = "saturation";
  context.fillStyle = "#808080";
  context.fillRect(0, 0, canvas.width, canvas.height);
  return context;
}

function drawOver(context: OffscreenCanvasRenderingContext2D, image: OffscreenCanvas, alpha: number): void {
  context.globalAlpha = alpha;
  context.drawImage(image, 0, 0);
  context.globalAlpha = 1;
}

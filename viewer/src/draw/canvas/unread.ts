import type { Rgb } from "../drawer";
import { PAINT, PALE, type DrawStyles } from "../drawStyle";
import type { Look } from "./look";
import { lightOn, type Lamp } from "./lightOn";
import { eachHidden } from "./mask";
import { eachFinished, eachHighlighted, packed, strengthIn, type Around, type Layers, type Said } from "./shade";

/**
 * A colour tile's picture made by compositing alone, for browsers that do not let pixels be read exactly. Light
 * multiplies sRGB values by its 2.2nd root, which stays within a few bytes of linear light.
 */
export function composed(look: Look, bitmap: ImageBitmap, layers: Layers, around: Around, { colors, finishes }: Said): ImageBitmap {
  const { width, height } = layers;
  const context = canvasOf(width, height);
  context.drawImage(bitmap, 0, 0);
  const hidden = finishes && layers.id ? finish(context, layers.id, finishes) : null;
  if (look.light && layers.shades) shine(context, look.light, lightOn(look.light, width, height, layers.shades, around.shades));
  context.globalCompositeOperation = "destination-in";
  context.drawImage(look.masked && layers.id ? imageOf(width, height, (at) => (layers.id?.[at] ? 0xff000000 : 0)) : bitmap, 0, 0);
  if (hidden) {
    context.globalCompositeOperation = "destination-out";
    context.drawImage(hidden, 0, 0);
  }
  if (colors) tint(context, look, layers, around, colors);
  if (layers.depth && around.masks.length > 0) {
    const behind = new Uint32Array(width * height);
    eachHidden(width, height, layers.depth, around.masks, (at) => (behind[at] = 0xff000000));
    context.globalCompositeOperation = "destination-out";
    context.drawImage(imageOf(width, height, (at) => behind[at] ?? 0), 0, 0);
  }
  return context.canvas.transferToImageBitmap();
}

/** Colours and greys laid over; what is hidden comes back as an image, since alpha is spoilt until the end. */
function finish(context: OffscreenCanvasRenderingContext2D, id: Uint32Array, finishes: DrawStyles): OffscreenCanvas {
  const { width, height } = context.canvas;
  const [paints, pale, hidden] = [new Uint32Array(id.length), new Uint32Array(id.length), new Uint32Array(id.length)];
  eachFinished(id, finishes, (at, word) => {
    const kind = word >>> 24;
    (kind === 1 ? paints : kind === 3 ? pale : hidden)[at] = kind === 1 ? (word | 0xff000000) >>> 0 : packed([PALE[0], PALE[0], PALE[0]]);
  });
  const greyed = greyOf(context.canvas);
  greyed.globalCompositeOperation = "destination-in";
  greyed.drawImage(imageOf(width, height, (at) => pale[at] ?? 0), 0, 0);
  context.globalCompositeOperation = "source-atop";
  layOver(context, greyed.canvas, 1);
  layOver(context, imageOf(width, height, (at) => pale[at] ?? 0), PALE[1]);
  layOver(context, imageOf(width, height, (at) => paints[at] ?? 0), PAINT);
  return imageOf(width, height, (at) => hidden[at] ?? 0);
}

function canvasOf(width: number, height: number): OffscreenCanvasRenderingContext2D {
  return new OffscreenCanvas(width, height).getContext("2d") as OffscreenCanvasRenderingContext2D;
}

/** @param word little-endian RGBA of a pixel */
function imageOf(width: number, height: number, word: (at: number) => number): OffscreenCanvas {
  const words = Uint32Array.from({ length: width * height }, (_, at) => word(at));
  const context = canvasOf(width, height);
  context.putImageData(new ImageData(new Uint8ClampedArray(words.buffer), width, height), 0, 0);
  return context.canvas;
}

/** Light up to 1 multiplies; what is above 1 divides by its inverse, which "color-dodge" does. Alpha is spoilt. */
function shine(context: OffscreenCanvasRenderingContext2D, lamp: Lamp, shares: Float32Array): void {
  const { width, height } = context.canvas;
  const roots = ([0, 1, 2] as const).map((channel) => {
    const strength = strengthIn(lamp, channel);
    return Float32Array.from({ length: width * height }, (_, at) => strength(shares[2 * at] as number, shares[2 * at + 1] as number) ** (1 / 2.2));
  });
  const wordOf = (at: number, byte: (root: number) => number): number => packed(roots.map((root) => byte(root[at] ?? 1)) as unknown as Rgb);
  // Drawn upon themselves, pixels in part covered become opaque and keep their colour, as blending wants it.
  context.globalCompositeOperation = "source-over";
  for (let k = 0; k < 8; k++) context.drawImage(context.canvas, 0, 0);
  context.globalCompositeOperation = "multiply";
  context.drawImage(imageOf(width, height, (at) => wordOf(at, (root) => Math.min(root, 1))), 0, 0);
  if (!roots.some((channel) => channel.some((root) => root > 1))) return;
  context.globalCompositeOperation = "color-dodge";
  context.drawImage(imageOf(width, height, (at) => wordOf(at, (root) => Math.max(1 - 1 / root, 0))), 0, 0);
}

/** tint × (½ + 0.65 grey) over 28 % of the colour; the rim on top, opaque. */
function tint(context: OffscreenCanvasRenderingContext2D, look: Look, layers: Layers, around: Around, colors: ReadonlyMap<number, Rgb>): void {
  const { width, height } = layers;
  const [bodies, rims] = [new Uint32Array(width * height), new Uint32Array(width * height)];
  eachHighlighted(look, layers, around, colors, (at, color, rim) => {
    (rim ? rims : bodies)[at] = packed(color);
  });
  const tints = imageOf(width, height, (at) => bodies[at] ?? 0);
  const shadows = greyOf(context.canvas);
  shadows.globalCompositeOperation = "multiply";
  shadows.drawImage(tints, 0, 0);
  const body = canvasOf(width, height);
  body.globalCompositeOperation = "lighter";
  layOver(body, shadows.canvas, 0.65);
  layOver(body, tints, 0.5);
  body.globalCompositeOperation = "destination-in";
  layOver(body, tints, 1);
  context.globalCompositeOperation = "source-atop";
  layOver(context, body.canvas, 0.72);
  context.globalCompositeOperation = "source-over";
  layOver(context, imageOf(width, height, (at) => rims[at] ?? 0), 1);
}

function greyOf(canvas: OffscreenCanvas): OffscreenCanvasRenderingContext2D {
  const context = canvasOf(canvas.width, canvas.height);
  context.drawImage(canvas, 0, 0);
  context.globalCompositeOperation = "saturation";
  context.fillStyle = "#808080";
  context.fillRect(0, 0, canvas.width, canvas.height);
  return context;
}

function layOver(context: OffscreenCanvasRenderingContext2D, image: OffscreenCanvas, alpha: number): void {
  context.globalAlpha = alpha;
  context.drawImage(image, 0, 0);
  context.globalAlpha = 1;
}

import { DrawError, UsageError, type map } from "../map3d";
import { Furniture } from "./furniture";
import { paintPieces, type Watch } from "./pieces";

/** What colours stand for; a `theme` is one. */
export interface PictureLegend {
  readonly title: string;
  readonly classes: readonly { readonly label: string; readonly color: string }[];
  /** Those that are shown. Default: all classes. */
  readonly chosen?: PictureLegend["classes"];
}

export interface PictureOptions extends Watch {
  /** Picture pixels; of one of them follows the other. Default: the map's CSS pixels times `scale`. What the map shows is seen whole; a picture of other proportions shows more. */
  width_px?: number;
  height_px?: number;
  /** Picture pixels a CSS pixel of the map, where no size is given. Default 2. */
  scale?: number;
  /** Text, in the left top corner. Default none. */
  title?: string;
  /** In the left bottom corner. Default none. */
  legend?: PictureLegend;
  /** Default: the layers'. */
  attribution?: string;
  /** Default true. */
  scaleBar?: boolean;
  /** Default true. */
  northArrow?: boolean;
  /** The map's markers, with their labels. Default true. */
  markers?: boolean;
  /** Any CSS colour; "transparent": none. Default: the map's. */
  background?: string;
  /** Picture pixels a CSS pixel of texts; 300 dpi are 3.125. Default: as large as beside the map. */
  textScale?: number;
  /** Stops it: the promise is rejected with the signal's reason. */
  signal?: AbortSignal;
  /** Called with pieces that are done, and all. */
  progress?: (done: number, total: number) => void;
}

export const LONGEST_SIDE_PX = 8192;

/**
 * What a map shows as a PNG picture of any size up to 8,192 pixels a side, with tiles as fine as that needs, in the map's looks.
 * @throws UsageError for sizes out of range or what is no colour; FetchError, DecodeError when a tile cannot be had; DrawError when the browser has no room
 */
export async function exportPicture(shown: map, options: PictureOptions = {}): Promise<Blob> {
  const { clientWidth, clientHeight } = shown.canvas;
  const { width_px, height_px, scale: wanted = (width_px ?? NaN) / clientWidth || (height_px ?? NaN) / clientHeight || 2 } = options;
  const [width, height] = [width_px ?? Math.round(clientWidth * wanted), height_px ?? Math.round(clientHeight * wanted)];
  for (const [name, side] of [["width", width], ["height", height]] as const) checkSide(name, side);
  const scale = Math.min(width / clientWidth, height / clientHeight);
  const context = contextOf(width, height);
  paintBackground(context, options.background ?? getComputedStyle(shown.container).backgroundColor);
  const furniture = new Furniture(shown, context, scale, options.textScale ?? scale);
  const credit = options.attribution ?? shown.attributions.join(" · ");
  await paintPieces(shown, { width, height, scale }, context, options);
  furniture.begin();
  if (options.markers ?? true) furniture.markers();
  if (options.northArrow ?? true) furniture.northArrow();
  if (options.title) furniture.title(options.title);
  furniture.foot(options.legend, options.scaleBar ?? true, credit);
  return encoded(context.canvas);
}

function checkSide(name: string, side: number): void {
  if (!Number.isInteger(side) || side < 1 || side > LONGEST_SIDE_PX) throw new UsageError(`a picture's ${name} is a whole number from 1 to ${String(LONGEST_SIDE_PX)} pixels, got ${String(side)}`);
}

/** @throws DrawError when there is no room; browsers do not say so themselves, they draw nothing */
function contextOf(width: number, height: number): CanvasRenderingContext2D {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  context?.fillRect(width - 1, height - 1, 1, 1);
  if (context?.getImageData(width - 1, height - 1, 1, 1).data[3] !== 255) throw new DrawError(`this browser has no room for a picture of ${String(width)} × ${String(height)} pixels; take a smaller one`);
  context.clearRect(0, 0, width, height);
  return context;
}

function paintBackground(context: CanvasRenderingContext2D, color: string): void {
  if (!CSS.supports("color", color)) throw new UsageError(`background "${color}" is no colour`);
  context.fillStyle = color;
  context.fillRect(0, 0, context.canvas.width, context.canvas.height);
}

function encoded(canvas: HTMLCanvasElement): Promise<Blob> {
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => {
      if (blob) resolve(blob);
      else reject(new DrawError(`this browser cannot write a picture of ${String(canvas.width)} × ${String(canvas.height)} pixels; take a smaller one`));
    }, "image/png");
  });
}

import { DrawError, UsageError, type Map3D } from "../map3d";
import { Decorations, type PictureLegend } from "./decorations";
import { drawPieces, type PieceOptions } from "./pieces";

/** Options of `exportPicture`. */
export interface PictureOptions extends PieceOptions {
  /** Size in pixels; give one to keep the map's aspect ratio. Default: the map's CSS size times `scale`. The picture contains the whole view; with another aspect ratio it shows more. */
  width_px?: number;
  /** Height. Default: from the width and the aspect ratio of the map. */
  height_px?: number;
  /** Picture pixels per CSS pixel of the map, if no size is given. Default 2. */
  scale?: number;
  /** Title, in the top left corner. Default: none. */
  title?: string;
  /** Legend, in the bottom left corner. Default: none. */
  legend?: PictureLegend;
  /** Attribution text. Default: that of the layers. */
  attribution?: string;
  /** Draw a scale bar. Default true. */
  scaleBar?: boolean;
  /** Draw a north arrow. Default true. */
  northArrow?: boolean;
  /** Draw the map's markers and labels. Default true. */
  markers?: boolean;
  /** Draws over the map, below markers and texts. The unit is a CSS pixel of the map, from its top left corner. Default: nothing. */
  overlay?: (context: CanvasRenderingContext2D) => void;
  /** Any CSS colour, "transparent" for none. Default: that of the map. */
  background?: string;
  /** Picture pixels per CSS pixel of text; 3.125 for 300 dpi. Default: the scale of the map. */
  textScale?: number;
  /** Aborts the export; the promise rejects with the signal's reason. Default: none. */
  signal?: AbortSignal;
  /** Called after each piece with the number of finished pieces and their total. Default: none. */
  progress?: (done: number, total: number) => void;
}

/** Largest width and height of a picture. */
export const LONGEST_SIDE_PX = 8192;

/**
 * Exports the current view of a map as a PNG image of up to 8,192 pixels per side, with the map's styles, light and highlights, and tiles as fine as the size
 * needs. @throws UsageError for a size out of range or an invalid colour; FetchError or DecodeError when a tile fails; DrawError when the browser has too little
 * memory
 */
export async function exportPicture(shown: Map3D, options: PictureOptions = {}): Promise<Blob> {
  const { clientWidth, clientHeight } = shown.canvas;
  const { width_px, height_px, scale: requested = (width_px ?? NaN) / clientWidth || (height_px ?? NaN) / clientHeight || 2 } = options;
  const [width, height] = [width_px ?? Math.round(clientWidth * requested), height_px ?? Math.round(clientHeight * requested)];
  for (const [name, side] of [
    ["width", width],
    ["height", height],
  ] as const)
    checkSide(name, side);
  const scale = Math.min(width / clientWidth, height / clientHeight);
  const context = createContext(width, height);
  fillBackground(context, options.background ?? getComputedStyle(shown.container).backgroundColor);
  const decorations = new Decorations(shown, context, scale, options.textScale ?? scale);
  const attribution = options.attribution ?? shown.attributions.join(" · ");
  await drawPieces(shown, { width, height, scale }, context, options);
  drawOverlay(context, { clientWidth, clientHeight }, scale, options.overlay);
  decorations.begin();
  if (options.markers ?? true) decorations.markers();
  if (options.northArrow ?? true) decorations.northArrow();
  if (options.title) decorations.title(options.title);
  decorations.footer(options.legend, options.scaleBar ?? true, attribution);
  return encodePng(context.canvas);
}

function checkSide(name: string, side: number): void {
  if (!Number.isInteger(side) || side < 1 || side > LONGEST_SIDE_PX)
    throw new UsageError(`the picture's ${name} must be a whole number from 1 to ${String(LONGEST_SIDE_PX)} pixels, got ${String(side)}`);
}

/** Creates a canvas and checks that it works: without enough memory, browsers silently draw nothing. @throws DrawError */
function createContext(width: number, height: number): CanvasRenderingContext2D {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  context?.fillRect(width - 1, height - 1, 1, 1);
  if (context?.getImageData(width - 1, height - 1, 1, 1).data[3] !== 255)
    throw new DrawError(
      `the browser has too little memory for a picture of ${String(width)} × ${String(height)} pixels; choose a smaller size`,
    );
  context.clearRect(0, 0, width, height);
  return context;
}

function fillBackground(context: CanvasRenderingContext2D, color: string): void {
  if (!CSS.supports("color", color)) throw new UsageError(`background must be a CSS colour, got "${color}"`);
  context.fillStyle = color;
  context.fillRect(0, 0, context.canvas.width, context.canvas.height);
}

/** Draws over the map, which is in the middle of the picture. */
function drawOverlay(
  context: CanvasRenderingContext2D,
  { clientWidth, clientHeight }: Pick<Element, "clientWidth" | "clientHeight">,
  scale: number,
  draw: PictureOptions["overlay"],
): void {
  context.save();
  context.setTransform(
    scale,
    0,
    0,
    scale,
    (context.canvas.width - clientWidth * scale) / 2,
    (context.canvas.height - clientHeight * scale) / 2,
  );
  draw?.(context);
  context.restore();
}

function encodePng(canvas: HTMLCanvasElement): Promise<Blob> {
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => {
      if (blob) resolve(blob);
      else
        reject(
          new DrawError(
            `the browser could not encode a picture of ${String(canvas.width)} × ${String(canvas.height)} pixels; choose a smaller size`,
          ),
        );
    }, "image/png");
  });
}

import type { FetchFunction, LayerKind, Tile, View } from "../map3d";
import type { TileCamera } from "./grid";
import type { RequestedImage } from "./imageFormats";
import { readImageHeader } from "./imageHeader";
import { essenceOf, splitMultipart } from "./multipart";
import { PortrayalError } from "./portrayalError";
import { viewUrl, type ViewTemplate } from "./requestUrls";
import { fetchAnswer, type ServiceAnswer } from "./serviceFetch";

/** Requests for images of one tile within this time become one GetView. */
const COLLECT_MS = 12;
/** Largest answer: twice the pixels, and some for headers. */
const [BYTES_PER_PIXEL, HEADER_BYTES] = [8, 65_536] as const;

interface Waiting {
  readonly image: RequestedImage;
  readonly signal: AbortSignal | undefined;
  readonly resolve: (bytes: ArrayBuffer) => void;
  readonly reject: (reason: unknown) => void;
}

/**
 * Requests the images of tiles. Several images of a tile are one request with an answer of several parts (OGC 15-001r4 §10.6), so that the service
 * computes the view once; a service that does not answer so is asked for each image.
 */
export class ViewRequests {
  readonly #template: ViewTemplate;
  readonly #fetch: FetchFunction;
  readonly #collecting = new Map<string, Waiting[]>();
  /** undefined: not known yet. */
  #multipart: boolean | undefined;

  constructor(template: ViewTemplate, fetch: FetchFunction, multipart: boolean | undefined) {
    [this.#template, this.#fetch, this.#multipart] = [template, fetch, multipart];
  }

  /** Fetches an image of a tile. @throws PortrayalError, FetchError, or the signal's reason */
  request(view: View, tile: Tile, camera: TileCamera, image: RequestedImage, signal?: AbortSignal): Promise<ArrayBuffer> {
    if (this.#multipart === false) return this.#fetchImages(camera, [image], signal).then(([bytes]) => bytes as ArrayBuffer);
    return new Promise((resolve, reject) => {
      const key = [view.id, tile.z, tile.x, tile.y].join("/");
      const waiting = this.#collecting.get(key) ?? [];
      if (waiting.push({ image, signal, resolve, reject }) === 1) {
        this.#collecting.set(key, waiting);
        setTimeout(() => {
          this.#collecting.delete(key);
          void this.#send(camera, waiting);
        }, COLLECT_MS);
      }
    });
  }

  async #send(camera: TileCamera, collected: readonly Waiting[]): Promise<void> {
    const waiting = collected.filter(({ signal }) => signal?.aborted !== true);
    for (const { signal, reject } of collected) if (signal?.aborted === true) reject(signal.reason);
    if (waiting.length === 0) return;
    const kinds = new Map<LayerKind, RequestedImage>(waiting.map(({ image }) => [image.kind, image]));
    const images = [...kinds.values()];
    const ending = abortWhenAll(waiting);
    try {
      const found = await this.#fetchTogether(camera, images, ending.signal);
      // A copy for each: the receivers move the bytes to other threads.
      for (const { image, resolve } of waiting)
        resolve((found[images.indexOf(kinds.get(image.kind) as RequestedImage)] as ArrayBuffer).slice(0));
    } catch (reason) {
      for (const { signal, reject } of waiting) reject(signal?.aborted === true ? signal.reason : reason);
    } finally {
      ending.release();
    }
  }

  /** Asks for several images at once, and for each of them if the service cannot answer that. */
  async #fetchTogether(camera: TileCamera, images: readonly RequestedImage[], signal: AbortSignal): Promise<ArrayBuffer[]> {
    if (images.length === 1) return this.#fetchImages(camera, images, signal);
    if (this.#multipart !== false) {
      try {
        const found = await this.#fetchImages(camera, images, signal);
        this.#multipart = true;
        return found;
      } catch (reason) {
        if (this.#multipart === true || !(reason instanceof PortrayalError)) throw reason;
      }
    }
    const found = await Promise.all(images.map(async (image) => (await this.#fetchImages(camera, [image], signal))[0] as ArrayBuffer));
    this.#multipart = false;
    return found;
  }

  async #fetchImages(camera: TileCamera, images: readonly RequestedImage[], signal?: AbortSignal): Promise<ArrayBuffer[]> {
    const { endpoint, side_px } = this.#template;
    const where = `${endpoint}: GetView of ${images.map(({ identifier }) => identifier).join(", ")}`;
    const limit_bytes = images.length * (side_px * side_px * BYTES_PER_PIXEL + HEADER_BYTES);
    const answer = await fetchAnswer({ url: viewUrl(this.#template, camera, images), where, limit_bytes, fetch: this.#fetch, signal });
    const parts = splitAnswer(answer, images.length, where);
    return parts.map(({ mediaType, bytes }, k) => checkImage(bytes, mediaType, images[k] as RequestedImage, side_px, where));
  }
}

function splitAnswer({ contentType, bytes }: ServiceAnswer, count: number, where: string): { mediaType: string; bytes: ArrayBuffer }[] {
  const mediaType = essenceOf(contentType);
  if (!mediaType.startsWith("multipart/")) {
    if (count > 1)
      throw new PortrayalError(`${where}: expected ${String(count)} images as multipart/mixed, got ${mediaType || "no content type"}`);
    return [{ mediaType, bytes }];
  }
  const parts = splitMultipart(bytes, contentType);
  if (parts?.length !== count)
    throw new PortrayalError(
      `${where}: expected ${String(count)} images, got ${parts ? String(parts.length) : "a multipart message that is cut or malformed"}`,
    );
  return parts;
}

/** Checks type, size and end of an image before it is decoded. @throws PortrayalError */
function checkImage(
  bytes: ArrayBuffer,
  mediaType: string,
  { mediaType: wanted }: RequestedImage,
  side_px: number,
  where: string,
): ArrayBuffer {
  const fail = (got: string): never => {
    throw new PortrayalError(`${where}: expected ${wanted} of ${String(side_px)} × ${String(side_px)} pixels, got ${got}`);
  };
  if (bytes.byteLength === 0) return fail("an answer without content: the service does not say why");
  const said = mediaType.replace("image/jpg", "image/jpeg");
  if (said !== wanted) return fail(`${mediaType || "no content type"} of ${String(bytes.byteLength)} bytes`);
  const header = readImageHeader(new Uint8Array(bytes));
  if (header?.mediaType !== wanted) return fail(`${header?.mediaType ?? "something else"} that is declared as ${mediaType}`);
  if (header.width !== side_px || header.height !== side_px) return fail(`${String(header.width)} × ${String(header.height)} pixels`);
  return header.complete ? bytes : fail(`an image that is cut after ${String(bytes.byteLength)} bytes`);
}

/** Returns a signal that aborts when all of those who wait have aborted. */
function abortWhenAll(waiting: readonly Waiting[]): { signal: AbortSignal; release(): void } {
  const ending = new AbortController();
  const check = (): void => {
    if (waiting.every(({ signal }) => signal?.aborted === true)) ending.abort();
  };
  for (const { signal } of waiting) signal?.addEventListener("abort", check);
  return {
    signal: ending.signal,
    release: () => {
      for (const { signal } of waiting) signal?.removeEventListener("abort", check);
    },
  };
}

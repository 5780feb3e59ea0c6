import workerCode from "worker:./shadeTile.worker.ts";
import { DrawError } from "../../core/errors";
import type { ShadeMessage, ShadeRequest, ShadeResponse, TileImage, WorkerValue } from "./shadeMessages";

const close = (image: TileImage | undefined): void => {
  if (image && "close" in image) image.close();
};

/** The picture of a tile; `image` is undefined until it is first shaded. */
export interface TilePicture {
  readonly name: string;
  /** Names of its data in the worker. */
  readonly inputs: Set<string>;
  image: TileImage | undefined;
  /** The options of the last image, or of the last attempt. */
  options: string;
  /** A bit for each neighbouring tile that it used. */
  edges: number;
  /** Ticket of the last request; tickets increase. */
  ticket: number;
}

/** A request for a picture. Smaller urgencies come first; an empty one needs no work. */
export interface PictureRequest {
  readonly picture: TilePicture;
  readonly options: string;
  readonly edges: number;
  readonly request: Omit<ShadeRequest, "ticket">;
  readonly urgency: readonly number[];
}

export interface TilePicturesEvents {
  /** A picture is ready. */
  made(): void;
  failed(error: Error): void;
}

/** Requests sent to the worker at once: one in progress, one waiting, so that it is never idle. */
const MAX_REQUESTS = 2;

/** Keeps tile pictures, shaded by a worker. The worker is created from a blob, like those of the decoder. */
export class TilePictures {
  readonly #events: TilePicturesEvents;
  readonly #pictures = new Map<string, TilePicture>();
  readonly #running = new Map<number, PictureRequest>();
  #worker: Worker | undefined;
  #waiting: PictureRequest[] = [];
  #tickets = 0;
  #stopped = false;

  constructor(events: TilePicturesEvents) {
    this.#events = events;
  }

  /** Whether requests are running or waiting. */
  get busy(): boolean {
    return this.#running.size + this.#waiting.length > 0;
  }

  get(name: string): TilePicture | undefined {
    return this.#pictures.get(name);
  }

  /** Returns a picture, created without an image if it is new. */
  getOrCreate(name: string): TilePicture {
    const known = this.#pictures.get(name) ?? { name, inputs: new Set<string>(), image: undefined, options: "", edges: 0, ticket: 0 };
    this.#pictures.set(name, known);
    return known;
  }

  /** Stores a value in the worker. */
  put(name: string, value: WorkerValue, transfer: Transferable[] = []): void {
    this.#post({ put: name, value }, transfer);
  }

  drop(name: string): void {
    if (this.#worker) this.#post({ drop: name });
  }

  /** Replaces the waiting requests. */
  setRequests(requests: PictureRequest[]): void {
    const running = new Map([...this.#running.values()].map((request) => [request.picture, request]));
    const isOutdated = ({ picture, options, edges }: PictureRequest): boolean =>
      running.get(picture)?.options !== options || ((running.get(picture)?.edges ?? 0) & edges) !== edges;
    this.#waiting = this.#stopped ? [] : requests.filter(isOutdated).sort((a, b) => compare(a.urgency, b.urgency));
    this.#fill();
  }

  forget(name: string): void {
    close(this.#pictures.get(name)?.image);
    this.#pictures.delete(name);
    this.#waiting = this.#waiting.filter(({ picture }) => picture.name !== name);
  }

  /** Drops the images of pictures that a predicate selects. */
  prune(stale: (picture: TilePicture) => boolean): void {
    for (const picture of this.#pictures.values()) {
      if (!picture.image || !stale(picture)) continue;
      close(picture.image);
      Object.assign(picture, { image: undefined, options: "" });
    }
  }

  stop(): void {
    this.#stopped = true;
    this.#worker?.terminate();
    this.#worker = undefined;
    this.#running.clear();
    this.#waiting = [];
    for (const name of [...this.#pictures.keys()]) this.forget(name);
  }

  #fill(): void {
    while (this.#running.size < MAX_REQUESTS) {
      const request = this.#waiting.shift();
      if (!request) return;
      const ticket = ++this.#tickets;
      this.#running.set(ticket, request);
      this.#post({ ...request.request, ticket });
    }
  }

  #post(message: ShadeMessage, transfer: Transferable[] = []): void {
    if (this.#stopped) return;
    this.#worker ??= this.#start();
    this.#worker.postMessage(message, transfer);
  }

  #start(): Worker {
    const url = URL.createObjectURL(new Blob([workerCode], { type: "text/javascript" }));
    const worker = new Worker(url, { name: "map3d canvas" });
    worker.onmessage = ({ data }: MessageEvent<ShadeResponse>) => this.#settle(data);
    worker.onerror = (event) => {
      this.stop();
      this.#events.failed(
        new DrawError(
          `cannot shade tiles: ${event.message || "the worker is blocked; add worker-src blob: to the page's Content-Security-Policy"}`,
        ),
      );
    };
    return worker;
  }

  #settle(response: ShadeResponse): void {
    const request = this.#running.get(response.ticket);
    this.#running.delete(response.ticket);
    if (request) this.#store(request, response);
    this.#fill();
    this.#events.made();
  }

  #store({ picture, options, edges }: PictureRequest, response: ShadeResponse): void {
    if ("error" in response) this.#events.failed(new DrawError(`tile ${picture.name}: ${response.error}`));
    const image = "picture" in response ? response.picture : undefined;
    if (this.#pictures.get(picture.name) !== picture) {
      close(image);
      return;
    }
    if (image) {
      close(picture.image);
      picture.image = image;
    }
    Object.assign(picture, { options, edges, ticket: response.ticket });
  }
}

function compare(a: readonly number[], b: readonly number[]): number {
  const at = a.findIndex((value, k) => value !== b[k]);
  return at < 0 ? 0 : (a[at] ?? 0) - (b[at] ?? 0);
}

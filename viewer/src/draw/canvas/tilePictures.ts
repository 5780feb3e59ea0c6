import workerCode from "worker:./shadeTile.worker.ts";
import { DrawError } from "../../core/errors";
import type { ShadeMessage, ShadeRequest, ShadeResponse, TileImage, WorkerValue } from "./shadeMessages";

const close = (image: TileImage | undefined): void => {
  if (image && "close" in image) image.close();
};

/** A tile's picture, as far as one has been made. */
export interface TilePicture {
  readonly name: string;
  /** Names of the data that the worker has for it. */
  readonly inputs: Set<string>;
  image: TileImage | undefined;
  /** The look that was made last, or tried. */
  options: string;
  /** Bit by bit, the tiles beside it that were here then. */
  edges: number;
  /** When that was: tickets count up. */
  ticket: number;
}

/** A picture to make; the least urgency comes first. None: it is there. */
export interface PictureRequest {
  readonly picture: TilePicture;
  readonly options: string;
  readonly edges: number;
  readonly request: Omit<ShadeRequest, "ticket">;
  readonly urgency: readonly number[];
}

export interface TilePicturesEvents {
  /** A picture is new. */
  made(): void;
  failed(error: Error): void;
}

/** Orders at the worker at once: one in the making, one waiting, so that it is never idle. */
const MAX_REQUESTS = 2;

/** Has tile pictures made by a worker and keeps them. The worker comes from a blob, as the decoder's do. */
export class TilePictures {
  readonly #events: TilePicturesEvents;
  readonly #pictures = new Map<string, TilePicture>();
  readonly #running = new Map<number, PictureRequest>();
  #worker: Worker | undefined;
  #waiting: PictureRequest[] = [];
  #tickets = 0;
  #stopped = false;
  #readsExactly: boolean | undefined;

  constructor(events: TilePicturesEvents) {
    this.#events = events;
  }

  /** Something is being made, or to be made. */
  get busy(): boolean {
    return this.#running.size + this.#waiting.length > 0;
  }

  /** Colours are lit by compositing, since this browser does not let pixels be read as they are. */
  get usesCompositing(): boolean {
    return this.#readsExactly === false;
  }

  get(name: string): TilePicture | undefined {
    return this.#pictures.get(name);
  }

  /** The picture's place; empty at first. */
  getOrCreate(name: string): TilePicture {
    const known = this.#pictures.get(name) ?? { name, inputs: new Set<string>(), image: undefined, options: "", edges: 0, ticket: 0 };
    this.#pictures.set(name, known);
    return known;
  }

  /** Gives the worker data to make pictures from. */
  put(name: string, value: WorkerValue, transfer: Transferable[] = []): void {
    this.#post({ put: name, value }, transfer);
  }

  drop(name: string): void {
    if (this.#worker) this.#post({ drop: name });
  }

  /** All that is wanted from now on. */
  setRequests(wishes: PictureRequest[]): void {
    const making = new Map([...this.#running.values()].map((wish) => [wish.picture, wish]));
    const open = ({ picture, options, edges }: PictureRequest): boolean => making.get(picture)?.options !== options || ((making.get(picture)?.edges ?? 0) & edges) !== edges;
    this.#waiting = this.#stopped ? [] : wishes.filter(open).sort((a, b) => compare(a.urgency, b.urgency));
    this.#fill();
  }

  forget(name: string): void {
    close(this.#pictures.get(name)?.image);
    this.#pictures.delete(name);
    this.#waiting = this.#waiting.filter(({ picture }) => picture.name !== name);
  }

  /** Forgets pictures that nobody will see as they are. */
  prune(stale: (picture: TilePicture) => boolean): void {
    for (const picture of this.#pictures.values()) {
      if (!picture.image || !stale(picture)) continue;
      close(picture.image);
      Object.assign(picture, { image: undefined, look: "" });
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
      const wish = this.#waiting.shift();
      if (!wish) return;
      const ticket = ++this.#tickets;
      this.#running.set(ticket, wish);
      this.#post({ ...wish.request, ticket });
    }
  }

  #post(task: ShadeMessage, transfer: Transferable[] = []): void {
    if (this.#stopped) return;
    this.#worker ??= this.#start();
    this.#worker.postMessage(task, transfer);
  }

  #start(): Worker {
    const url = URL.createObjectURL(new Blob([workerCode], { type: "text/javascript" }));
    const worker = new Worker(url, { name: "map3d canvas" });
    worker.onmessage = ({ data }: MessageEvent<ShadeResponse>) => {
      if ("readsExactly" in data) this.#readsExactly = data.readsExactly;
      else this.#settle(data);
    };
    worker.onerror = (event) => {
      this.stop();
      this.#events.failed(new DrawError(`the map's pictures cannot be made: ${event.message || "the worker is blocked; the page's Content-Security-Policy needs worker-src blob:"}`));
    };
    return worker;
  }

  #settle(reply: Exclude<ShadeResponse, { readsExactly: boolean }>): void {
    const wish = this.#running.get(reply.ticket);
    this.#running.delete(reply.ticket);
    if (wish) this.#store(wish, reply);
    this.#fill();
    this.#events.made();
  }

  #store({ picture, options, edges }: PictureRequest, reply: Exclude<ShadeResponse, { readsExactly: boolean }>): void {
    if ("error" in reply) this.#events.failed(new DrawError(`tile ${picture.name}: ${reply.error}`));
    const image = "picture" in reply ? reply.picture : undefined;
    if (this.#pictures.get(picture.name) !== picture) {
      close(image);
      return;
    }
    if (image) {
      close(picture.image);
      picture.image = image;
    }
    Object.assign(picture, { options, edges, ticket: reply.ticket });
  }
}

function compare(a: readonly number[], b: readonly number[]): number {
  const at = a.findIndex((value, k) => value !== b[k]);
  return at < 0 ? 0 : (a[at] ?? 0) - (b[at] ?? 0);
}

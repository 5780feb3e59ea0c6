import workerCode from "worker:./shade.worker.ts";
import { DrawError } from "../../core/errors";
import type { Order, Reply, Task, Kept } from "./shade.worker";

/** Pixels, or a bitmap where the browser does not let them be read. */
export type Image = ImageData | ImageBitmap;

const close = (image: Image | undefined): void => {
  if (image && "close" in image) image.close();
};

/** A tile's picture, as far as one has been made. */
export interface Picture {
  readonly name: string;
  /** Names of the data that the worker has for it. */
  readonly parts: Set<string>;
  image: Image | undefined;
  /** The look that was made last, or tried. */
  look: string;
  /** Bit by bit, the tiles beside it that were here then. */
  edges: number;
  /** When that was: tickets count up. */
  ticket: number;
}

/** A picture to make; the least urgency comes first. None: it is there. */
export interface Wish {
  readonly picture: Picture;
  readonly look: string;
  readonly edges: number;
  readonly order: Omit<Order, "ticket">;
  readonly urgency: readonly number[];
}

export interface PicturesEvents {
  /** A picture is new. */
  made(): void;
  failed(error: Error): void;
}

/** Orders at the worker at once: one in the making, one waiting, so that it is never idle. */
const AT_ONCE = 2;

/** Has tile pictures made by a worker and keeps them. The worker comes from a blob, as the decoder's do. */
export class Pictures {
  readonly #events: PicturesEvents;
  readonly #known = new Map<string, Picture>();
  readonly #making = new Map<number, Wish>();
  #worker: Worker | undefined;
  #wishes: Wish[] = [];
  #tickets = 0;
  #dead = false;
  #exact: boolean | undefined;

  constructor(events: PicturesEvents) {
    this.#events = events;
  }

  /** Something is being made, or to be made. */
  get busy(): boolean {
    return this.#making.size + this.#wishes.length > 0;
  }

  /** Colours are lit by compositing, since this browser does not let pixels be read as they are. */
  get composed(): boolean {
    return this.#exact === false;
  }

  get(name: string): Picture | undefined {
    return this.#known.get(name);
  }

  /** The picture's place; empty at first. */
  of(name: string): Picture {
    const known = this.#known.get(name) ?? { name, parts: new Set<string>(), image: undefined, look: "", edges: 0, ticket: 0 };
    this.#known.set(name, known);
    return known;
  }

  /** Gives the worker data to make pictures from. */
  put(name: string, value: Kept, transfer: Transferable[] = []): void {
    this.#post({ put: name, value }, transfer);
  }

  drop(name: string): void {
    if (this.#worker) this.#post({ drop: name });
  }

  /** All that is wanted from now on. */
  want(wishes: Wish[]): void {
    const making = new Map([...this.#making.values()].map((wish) => [wish.picture, wish]));
    const open = ({ picture, look, edges }: Wish): boolean => making.get(picture)?.look !== look || ((making.get(picture)?.edges ?? 0) & edges) !== edges;
    this.#wishes = this.#dead ? [] : wishes.filter(open).sort((a, b) => compare(a.urgency, b.urgency));
    this.#fill();
  }

  forget(name: string): void {
    close(this.#known.get(name)?.image);
    this.#known.delete(name);
    this.#wishes = this.#wishes.filter(({ picture }) => picture.name !== name);
  }

  /** Forgets pictures that nobody will see as they are. */
  prune(stale: (picture: Picture) => boolean): void {
    for (const picture of this.#known.values()) {
      if (!picture.image || !stale(picture)) continue;
      close(picture.image);
      Object.assign(picture, { image: undefined, look: "" });
    }
  }

  stop(): void {
    this.#dead = true;
    this.#worker?.terminate();
    this.#worker = undefined;
    this.#making.clear();
    this.#wishes = [];
    for (const name of [...this.#known.keys()]) this.forget(name);
  }

  #fill(): void {
    while (this.#making.size < AT_ONCE) {
      const wish = this.#wishes.shift();
      if (!wish) return;
      const ticket = ++this.#tickets;
      this.#making.set(ticket, wish);
      this.#post({ ...wish.order, ticket });
    }
  }

  #post(task: Task, transfer: Transferable[] = []): void {
    if (this.#dead) return;
    this.#worker ??= this.#start();
    this.#worker.postMessage(task, transfer);
  }

  #start(): Worker {
    const url = URL.createObjectURL(new Blob([workerCode], { type: "text/javascript" }));
    const worker = new Worker(url, { name: "map3d canvas" });
    worker.onmessage = ({ data }: MessageEvent<Reply>) => {
      if ("exact" in data) this.#exact = data.exact;
      else this.#settle(data);
    };
    worker.onerror = (event) => {
      this.stop();
      this.#events.failed(new DrawError(`the map's pictures cannot be made: ${event.message || "the worker is blocked; the page's Content-Security-Policy needs worker-src blob:"}`));
    };
    return worker;
  }

  #settle(reply: Exclude<Reply, { exact: boolean }>): void {
    const wish = this.#making.get(reply.ticket);
    this.#making.delete(reply.ticket);
    if (wish) this.#take(wish, reply);
    this.#fill();
    this.#events.made();
  }

  #take({ picture, look, edges }: Wish, reply: Exclude<Reply, { exact: boolean }>): void {
    if ("error" in reply) this.#events.failed(new DrawError(`tile ${picture.name}: ${reply.error}`));
    const image = "picture" in reply ? reply.picture : undefined;
    if (this.#known.get(picture.name) !== picture) {
      close(image);
      return;
    }
    if (image) {
      close(picture.image);
      picture.image = image;
    }
    Object.assign(picture, { look, edges, ticket: reply.ticket });
  }
}

function compare(a: readonly number[], b: readonly number[]): number {
  const at = a.findIndex((value, k) => value !== b[k]);
  return at < 0 ? 0 : (a[at] ?? 0) - (b[at] ?? 0);
}

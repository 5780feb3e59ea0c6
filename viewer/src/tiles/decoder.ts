import workerCode from "worker:./decode.worker.ts";
import { DecodeError } from "../core/errors";
import type { Reply, Task } from "./decode.worker";
import type { TileData } from "./tileData";

interface Waiting {
  resolve(data: TileData): void;
  reject(reason: Error): void;
}

/** Workers that have had nothing to do for so long are ended: what they have thrown away (the buffers of each zlib stream above all) goes with them. Others start in milliseconds. */
const IDLE_MS = 2000;

/** Decodes tiles in workers made from a blob, so that the viewer is one file. A page's CSP must allow `worker-src blob:`. */
export class Decoder {
  readonly #waiting = new Map<number, Waiting>();
  readonly #workers: Worker[] = [];
  readonly #size: number;
  #url: string | undefined;
  #tickets = 0;
  #ending: ReturnType<typeof setTimeout> | undefined;

  constructor(workers: number) {
    this.#size = Math.max(1, workers);
  }

  decode(kind: string, mediaType: string, bytes: ArrayBuffer): Promise<TileData> {
    const ticket = this.#tickets++;
    const worker = this.#workers[ticket % this.#size] ?? this.#start();
    clearTimeout(this.#ending);
    return new Promise((resolve, reject) => {
      this.#waiting.set(ticket, { resolve, reject });
      const task: Task = { ticket, kind, mediaType, bytes };
      worker.postMessage(task, [bytes]);
    });
  }

  stop(): void {
    this.#end();
    if (this.#url) URL.revokeObjectURL(this.#url);
    this.#fail("the map was removed");
  }

  #end(): void {
    clearTimeout(this.#ending);
    for (const worker of this.#workers.splice(0)) worker.terminate();
  }

  #start(): Worker {
    this.#url ??= URL.createObjectURL(new Blob([workerCode], { type: "text/javascript" }));
    const worker = new Worker(this.#url, { name: "map3d decoder" });
    worker.onmessage = ({ data }: MessageEvent<Reply>) => {
      this.#settle(data);
    };
    worker.onerror = (event) => {
      this.#fail(`the tile decoder cannot run: ${event.message || "blocked; the page's Content-Security-Policy needs worker-src blob:"}`);
    };
    this.#workers.push(worker);
    return worker;
  }

  #settle(reply: Reply): void {
    const waiting = this.#waiting.get(reply.ticket);
    this.#waiting.delete(reply.ticket);
    if ("error" in reply) waiting?.reject(new DecodeError(reply.error));
    else waiting?.resolve(reply.data);
    if (this.#waiting.size === 0) this.#ending = setTimeout(() => { this.#end(); }, IDLE_MS);
  }

  #fail(why: string): void {
    for (const waiting of this.#waiting.values()) waiting.reject(new DecodeError(why));
    this.#waiting.clear();
  }
}

import workerCode from "worker:./decode.worker.ts";
import { DecodeError } from "../core/errors";
import type { Reply, Task } from "./decode.worker";
import type { TileData } from "./tileData";

interface Waiting {
  resolve(data: TileData): void;
  reject(reason: Error): void;
}

/** Decodes tiles in workers made from a blob, so that the viewer is one file. A page's CSP must allow `worker-src blob:`. */
export class Decoder {
  readonly #waiting = new Map<number, Waiting>();
  readonly #workers: Worker[] = [];
  readonly #size: number;
  #tickets = 0;

  constructor(workers: number) {
    this.#size = Math.max(1, workers);
  }

  decode(kind: string, mediaType: string, bytes: ArrayBuffer): Promise<TileData> {
    const ticket = this.#tickets++;
    const worker = this.#workers[ticket % this.#size] ?? this.#start();
    return new Promise((resolve, reject) => {
      this.#waiting.set(ticket, { resolve, reject });
      const task: Task = { ticket, kind, mediaType, bytes };
      worker.postMessage(task, [bytes]);
    });
  }

  stop(): void {
    for (const worker of this.#workers.splice(0)) worker.terminate();
    this.#fail("the map was removed");
  }

  #start(): Worker {
    const url = URL.createObjectURL(new Blob([workerCode], { type: "text/javascript" }));
    const worker = new Worker(url, { name: "map3d decoder" });
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
  }

  #fail(why: string): void {
    for (const waiting of this.#waiting.values()) waiting.reject(new DecodeError(why));
    this.#waiting.clear();
  }
}

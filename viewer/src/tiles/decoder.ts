import workerCode from "worker:./decode.worker.ts";
import { DecodeError } from "../core/errors";
import type { DecodeResponse, DecodeRequest } from "./decodeMessages";
import type { TileData } from "./tileData";

interface PendingDecode {
  resolve(data: TileData): void;
  reject(reason: Error): void;
}

/** Workers that have had nothing to do for so long are ended: what they have thrown away (the buffers of each zlib stream above all) goes with them. Others start in milliseconds. */
const IDLE_MS = 2000;

/** Decodes tiles in workers made from a blob, so that the viewer is one file. A page's CSP must allow `worker-src blob:`. */
export class Decoder {
  readonly #pending = new Map<number, PendingDecode>();
  readonly #workers: Worker[] = [];
  readonly #size: number;
  #url: string | undefined;
  #requestCount = 0;
  #idleTimer: ReturnType<typeof setTimeout> | undefined;

  constructor(workers: number) {
    this.#size = Math.max(1, workers);
  }

  decode(kind: string, mediaType: string, bytes: ArrayBuffer): Promise<TileData> {
    const id = this.#requestCount++;
    const worker = this.#workers[id % this.#size] ?? this.#startWorker();
    clearTimeout(this.#idleTimer);
    return new Promise((resolve, reject) => {
      this.#pending.set(id, { resolve, reject });
      const task: DecodeRequest = { id, kind, mediaType, bytes };
      worker.postMessage(task, [bytes]);
    });
  }

  stop(): void {
    this.#endWorkers();
    if (this.#url) URL.revokeObjectURL(this.#url);
    this.#rejectAll("the map was removed");
  }

  #endWorkers(): void {
    clearTimeout(this.#idleTimer);
    for (const worker of this.#workers.splice(0)) worker.terminate();
  }

  #startWorker(): Worker {
    this.#url ??= URL.createObjectURL(new Blob([workerCode], { type: "text/javascript" }));
    const worker = new Worker(this.#url, { name: "map3d decoder" });
    worker.onmessage = ({ data }: MessageEvent<DecodeResponse>) => {
      this.#settle(data);
    };
    worker.onerror = (event) => {
      this.#rejectAll(`the tile decoder cannot run: ${event.message || "blocked; the page's Content-Security-Policy needs worker-src blob:"}`);
    };
    this.#workers.push(worker);
    return worker;
  }

  #settle(reply: DecodeResponse): void {
    const waiting = this.#pending.get(reply.id);
    this.#pending.delete(reply.id);
    if ("error" in reply) waiting?.reject(new DecodeError(reply.error));
    else waiting?.resolve(reply.data);
    if (this.#pending.size === 0) this.#idleTimer = setTimeout(() => { this.#endWorkers(); }, IDLE_MS);
  }

  #rejectAll(why: string): void {
    for (const waiting of this.#pending.values()) waiting.reject(new DecodeError(why));
    this.#pending.clear();
  }
}

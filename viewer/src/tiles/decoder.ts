import workerCode from "worker:./decode.worker.ts";
import { DecodeError } from "../core/errors";
import type { Tile } from "../geo/frame";
import type { DecodeResponse, DecodeRequest } from "./decodeMessages";
import type { TileData } from "./tileData";

interface PendingDecode {
  resolve(data: TileData): void;
  reject(reason: Error): void;
}

/** Idle workers end after this time, which frees their garbage (above all the buffers of zlib streams). New ones start within milliseconds. */
const IDLE_MS = 2000;

/** Decodes tiles in workers, created from a blob so that the viewer is one file. A page's CSP must allow `worker-src blob:`. */
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

  /** @param keep leaves the bytes to the caller; else they move to the worker  @param below the bytes are those of the tile of light above this one */
  decode(kind: string, mediaType: string, bytes: ArrayBuffer, keep = false, below?: Tile): Promise<TileData> {
    const id = this.#requestCount++;
    const worker = this.#workers[id % this.#size] ?? this.#startWorker();
    clearTimeout(this.#idleTimer);
    return new Promise((resolve, reject) => {
      this.#pending.set(id, { resolve, reject });
      const request: DecodeRequest = { id, kind, mediaType, bytes, below };
      worker.postMessage(request, keep ? [] : [bytes]);
    });
  }

  stop(): void {
    this.#endWorkers();
    if (this.#url) URL.revokeObjectURL(this.#url);
    this.#rejectAll("the map has been removed");
  }

  #endWorkers(): void {
    clearTimeout(this.#idleTimer);
    for (const worker of this.#workers.splice(0)) worker.terminate();
  }

  #startWorker(): Worker {
    this.#url ??= URL.createObjectURL(new Blob([workerCode], { type: "text/javascript" }));
    const worker = new Worker(this.#url, { name: "map3d decoder" });
    worker.onmessage = ({ data }: MessageEvent<DecodeResponse>) => this.#settle(data);
    worker.onerror = (event) => {
      this.#rejectAll(
        `cannot run the tile decoder: ${event.message || "the worker is blocked; add worker-src blob: to the page's Content-Security-Policy"}`,
      );
    };
    this.#workers.push(worker);
    return worker;
  }

  #settle(response: DecodeResponse): void {
    const pending = this.#pending.get(response.id);
    this.#pending.delete(response.id);
    if ("error" in response) pending?.reject(new DecodeError(response.error));
    else pending?.resolve(response.data);
    if (this.#pending.size === 0) this.#idleTimer = setTimeout(() => this.#endWorkers(), IDLE_MS);
  }

  #rejectAll(message: string): void {
    for (const pending of this.#pending.values()) pending.reject(new DecodeError(message));
    this.#pending.clear();
  }
}

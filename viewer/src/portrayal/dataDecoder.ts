import workerCode from "worker:./decodeData.worker.ts";
import { DecodeError, type TileData } from "../map3d";
import type { DataRequest, DataResponse } from "./decodeData";

interface PendingImage {
  readonly resolve: (data: TileData) => void;
  readonly reject: (reason: Error) => void;
}

/** An idle worker ends after this time. */
const IDLE_MS = 2000;

/** Decodes data images in a worker. A page's CSP must allow `worker-src blob:`. */
export class DataDecoder {
  readonly #pending = new Map<number, PendingImage>();
  #worker: Worker | undefined;
  #count = 0;
  #idleTimer: ReturnType<typeof setTimeout> | undefined;

  /** Takes the bytes over. @throws DecodeError */
  decode(request: Omit<DataRequest, "id">): Promise<TileData> {
    const id = this.#count++;
    const worker = (this.#worker ??= this.#start());
    clearTimeout(this.#idleTimer);
    return new Promise((resolve, reject) => {
      this.#pending.set(id, { resolve, reject });
      worker.postMessage({ ...request, id } satisfies DataRequest, [request.bytes]);
    });
  }

  #start(): Worker {
    const url = URL.createObjectURL(new Blob([workerCode], { type: "text/javascript" }));
    const worker = new Worker(url, { name: "map3d portrayal decoder" });
    worker.onmessage = ({ data }: MessageEvent<DataResponse>) => this.#settle(data);
    worker.onerror = (event) => {
      const error = new DecodeError(
        `cannot run the decoder: ${event.message || "the worker is blocked; add worker-src blob: to the page's Content-Security-Policy"}`,
      );
      for (const { reject } of this.#pending.values()) reject(error);
      this.#pending.clear();
      this.#end();
    };
    setTimeout(() => URL.revokeObjectURL(url), IDLE_MS);
    return worker;
  }

  #settle(response: DataResponse): void {
    const pending = this.#pending.get(response.id);
    this.#pending.delete(response.id);
    if ("error" in response) pending?.reject(new DecodeError(response.error));
    else pending?.resolve(response.data);
    if (this.#pending.size === 0) this.#idleTimer = setTimeout(() => this.#end(), IDLE_MS);
  }

  #end(): void {
    this.#worker?.terminate();
    this.#worker = undefined;
  }
}

export interface TileRequest {
  readonly key: string;
  run(signal: AbortSignal): Promise<void>;
}

interface RunningRequest {
  readonly abort: AbortController;
  readonly done: Promise<void>;
  /** A caller waits for it: it is not aborted when it leaves the view. */
  pinned: boolean;
}

/** Runs the wanted requests, at most `limit` at once, and aborts those that are no longer wanted. */
export class RequestQueue {
  readonly #running = new Map<string, RunningRequest>();
  readonly #limit: number;
  #waiting: TileRequest[] = [];

  constructor(limit: number) {
    this.#limit = limit;
  }

  get busy(): boolean {
    return this.#running.size + this.#waiting.length > 0;
  }

  /** Replaces the wanted requests, most urgent first. */
  setRequests(requests: readonly TileRequest[]): void {
    const keys = new Map([...requests].reverse().map((request) => [request.key, request]));
    for (const [key, running] of [...this.#running]) {
      if (keys.has(key) || running.pinned) continue;
      this.#running.delete(key);
      running.abort.abort();
    }
    this.#waiting = requests.filter((request) => keys.get(request.key) === request && !this.#running.has(request.key));
    this.#fill();
  }

  /** Runs a request at once, regardless of the limit, or joins it if it is running. Settles when it has ended. */
  runNow(request: TileRequest): Promise<void> {
    const running = this.#running.get(request.key) ?? this.#start(request);
    this.#waiting = this.#waiting.filter((other) => other.key !== request.key);
    running.pinned = true;
    return running.done;
  }

  #fill(): void {
    while (this.#running.size < this.#limit) {
      const request = this.#waiting.shift();
      if (!request) return;
      this.#start(request);
    }
  }

  #start(request: TileRequest): RunningRequest {
    const abort = new AbortController();
    const done = request.run(abort.signal).finally(() => {
      if (this.#running.get(request.key) === running) this.#running.delete(request.key);
      this.#fill();
    });
    const running: RunningRequest = { abort, done, pinned: false };
    this.#running.set(request.key, running);
    return running;
  }
}

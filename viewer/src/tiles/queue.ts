export interface TileRequest {
  readonly key: string;
  /** @param isAhead whether it is a prefetch */
  run(signal: AbortSignal, isAhead: () => boolean): Promise<void>;
}

interface RunningRequest {
  readonly abort: AbortController;
  readonly done: Promise<void>;
  /** A caller waits for it: it is not aborted when it leaves the view. */
  pinned: boolean;
  /** Whether it is a prefetch. */
  ahead: boolean;
}

/** Runs the wanted requests, at most `limit` at once, and aborts those that are no longer wanted. */
export class RequestQueue {
  readonly #running = new Map<string, RunningRequest>();
  readonly #limit: number;
  #waiting: TileRequest[] = [];
  /** Waiting requests that run when there are no others. */
  #ahead: TileRequest[] = [];

  constructor(limit: number) {
    this.#limit = limit;
  }

  /** Whether requests are running or waiting, apart from those ahead. */
  get busy(): boolean {
    return this.#waiting.length > 0 || [...this.#running.values()].some(({ ahead }) => !ahead);
  }

  /** Replaces the wanted requests, most urgent first. @param ahead requests that run when there are no others */
  setRequests(requests: readonly TileRequest[], ahead: readonly TileRequest[] = []): void {
    const keys = new Map([...requests, ...ahead].reverse().map((request) => [request.key, request]));
    const [wanted, later] = [requests, ahead].map((list) => list.filter((request) => keys.get(request.key) === request)) as [
      TileRequest[],
      TileRequest[],
    ];
    for (const [key, running] of [...this.#running]) {
      running.ahead = later.some((request) => request.key === key);
      if (keys.has(key) || running.pinned) continue;
      this.#running.delete(key);
      running.abort.abort();
    }
    [this.#waiting, this.#ahead] = [wanted, later].map((list) => list.filter(({ key }) => !this.#running.has(key))) as [
      TileRequest[],
      TileRequest[],
    ];
    this.#fill();
  }

  /** Runs a request at once, regardless of the limit, or joins it if it is running. Settles when it has ended. */
  runNow(request: TileRequest): Promise<void> {
    const running = this.#running.get(request.key) ?? this.#start(request);
    this.#waiting = this.#waiting.filter((other) => other.key !== request.key);
    this.#ahead = this.#ahead.filter((other) => other.key !== request.key);
    Object.assign(running, { pinned: true, ahead: false });
    return running.done;
  }

  #fill(): void {
    while (this.#running.size < this.#limit) {
      const request = this.#waiting.shift();
      const next = request ?? this.#ahead.shift();
      if (!next) return;
      this.#start(next, !request);
    }
  }

  #start(request: TileRequest, ahead = false): RunningRequest {
    const abort = new AbortController();
    const done = request
      .run(abort.signal, () => running.ahead)
      .finally(() => {
        if (this.#running.get(request.key) === running) this.#running.delete(request.key);
        this.#fill();
      });
    const running: RunningRequest = { abort, done, pinned: false, ahead };
    this.#running.set(request.key, running);
    return running;
  }
}

export interface TileRequest {
  readonly key: string;
  run(signal: AbortSignal): Promise<void>;
}

interface RunningRequest {
  readonly abort: AbortController;
  readonly done: Promise<void>;
  /** Somebody waits for it: not to be aborted when it leaves the view. */
  kept: boolean;
}

/** Runs what is wanted, at most `limit` jobs at once, and aborts what is wanted no longer. */
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

  /** All that is wanted from now on, most urgent first. */
  setRequests(jobs: readonly TileRequest[]): void {
    const keys = new Map([...jobs].reverse().map((job) => [job.key, job]));
    for (const [key, running] of [...this.#running]) {
      if (keys.has(key) || running.kept) continue;
      this.#running.delete(key);
      running.abort.abort();
    }
    this.#waiting = jobs.filter((job) => keys.get(job.key) === job && !this.#running.has(job.key));
    this.#fill();
  }

  /** Runs a job at once, beside the limit; joins it when it runs already. Settles when it has ended. */
  runNow(job: TileRequest): Promise<void> {
    const running = this.#running.get(job.key) ?? this.#start(job);
    this.#waiting = this.#waiting.filter((other) => other.key !== job.key);
    running.kept = true;
    return running.done;
  }

  #fill(): void {
    while (this.#running.size < this.#limit) {
      const job = this.#waiting.shift();
      if (!job) return;
      this.#start(job);
    }
  }

  #start(job: TileRequest): RunningRequest {
    const abort = new AbortController();
    const done = job.run(abort.signal).finally(() => {
      if (this.#running.get(job.key) === running) this.#running.delete(job.key);
      this.#fill();
    });
    const running: RunningRequest = { abort, done, kept: false };
    this.#running.set(job.key, running);
    return running;
  }
}

import { isOffline } from "./network";

/** An attempt that failed. */
export class FailedAttempt {
  readonly error: unknown;
  /** Can another attempt succeed? */
  readonly transient: boolean;
  /** The wait that the server asks for; undefined without one. */
  readonly retryAfter_ms: number | undefined;

  constructor(error: unknown, transient: boolean, retryAfter_ms?: number) {
    [this.error, this.transient, this.retryAfter_ms] = [error, transient, retryAfter_ms];
  }
}

export interface RetryOptions {
  /** Maximum number of attempts. Default 4. */
  attempts?: number | undefined;
  /** Wait before the second attempt; doubles each time. Default 250. */
  backoff_ms?: number | undefined;
  /** Ends the waits. Default: none. */
  signal?: AbortSignal | undefined;
}

/** Longest wait that a server may ask for. */
const MAX_WAIT_MS = 30_000;

/**
 * Repeats an attempt with growing waits while its failure is transient. Without a network there is one attempt, which a cache may answer.
 * @param run receives the number of failed attempts so far
 * @throws the error of the last attempt; the signal's reason when aborted during a wait
 */
export async function retry<T>(
  run: (failed: number) => Promise<T | FailedAttempt>,
  { attempts = 4, backoff_ms = 250, signal }: RetryOptions = {},
): Promise<T> {
  for (let failed = 0; ; failed++) {
    const result = await run(failed);
    if (!(result instanceof FailedAttempt)) return result;
    if (failed + 1 >= attempts || !result.transient || isOffline()) throw result.error;
    await wait(Math.min(result.retryAfter_ms ?? backoff_ms * 2 ** failed, MAX_WAIT_MS), signal);
  }
}

/** Is a response with this status worth another attempt? 501 stays. */
export const isTransientStatus = (status: number): boolean => status === 429 || (status >= 500 && status !== 501);

function wait(ms: number, signal: AbortSignal | undefined): Promise<void> {
  return new Promise((resolve, reject) => {
    const stop = (): void => {
      clearTimeout(timer);
      reject(signal?.reason as Error);
    };
    const timer = setTimeout(() => {
      signal?.removeEventListener("abort", stop);
      resolve();
    }, ms);
    signal?.addEventListener("abort", stop, { once: true });
  });
}

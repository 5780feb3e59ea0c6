import { FailedAttempt, isTransientStatus, retry } from "../core/retry";
import { FetchError, type FetchFunction } from "../map3d";
import { essenceOf } from "./multipart";
import { PortrayalError } from "./portrayalError";
import { attributeOf, parseXml, textOf } from "./xml";

/** How a document or image is fetched. */
export interface FetchRequest {
  readonly url: string;
  /** The service and the operation, for messages. */
  readonly where: string;
  readonly limit_bytes: number;
  readonly fetch: FetchFunction;
  readonly signal?: AbortSignal | undefined;
}

/** A complete answer. */
export interface ServiceAnswer {
  readonly contentType: string;
  readonly bytes: ArrayBuffer;
}

/** A service may compute a view for a while. */
const TIMEOUT_MS = 60_000;
const LATE = new Error("late");
const MAX_REPORT_BYTES = 1 << 16;

/**
 * Fetches an answer of a service. Repeats requests that fail for lack of a connection, and those that the service asks to repeat (429, 5xx except 501).
 * @throws PortrayalError for an exception of the service, FetchError, or the signal's reason
 */
export function fetchAnswer(request: FetchRequest): Promise<ServiceAnswer> {
  return retry(() => fetchOnce(request), { signal: request.signal });
}

async function fetchOnce(request: FetchRequest): Promise<ServiceAnswer | FailedAttempt> {
  const { url, where, signal } = request;
  const ending = new AbortController();
  const stop = (): void => ending.abort();
  signal?.throwIfAborted();
  signal?.addEventListener("abort", stop);
  const timer = setTimeout(() => ending.abort(LATE), TIMEOUT_MS);
  try {
    return await readAnswer(await request.fetch(url, { signal: ending.signal }), request, stop);
  } catch (reason) {
    signal?.throwIfAborted();
    if (reason instanceof FetchError || reason instanceof PortrayalError) return new FailedAttempt(reason, false);
    if (ending.signal.reason === LATE)
      return new FailedAttempt(new FetchError(`${where}: no complete answer within ${String(TIMEOUT_MS / 1000)} s`), false);
    const why = reason instanceof Error ? reason.message : String(reason);
    return new FailedAttempt(
      new FetchError(
        `${where}: no complete answer (${why}); the server cannot be reached, cut its answer, or does not allow pages of other origins (Access-Control-Allow-Origin)`,
      ),
      true,
    );
  } finally {
    clearTimeout(timer);
    signal?.removeEventListener("abort", stop);
  }
}

async function readAnswer(
  response: Response,
  { where, limit_bytes }: FetchRequest,
  stop: () => void,
): Promise<ServiceAnswer | FailedAttempt> {
  const { status, ok } = response;
  const contentType = response.headers.get("Content-Type") ?? "";
  const bytes = await readBytes(response, ok ? limit_bytes : Math.min(limit_bytes, MAX_REPORT_BYTES), where, stop);
  const exception = isXml(contentType, bytes) ? findException(bytes, where) : null;
  if (ok && !exception) return { contentType, bytes };
  const wait_s = Number(response.headers.get("Retry-After") ?? NaN);
  const error = exception ?? new FetchError(`${where}: HTTP ${String(status)}`, status);
  return new FailedAttempt(error, isTransientStatus(status), wait_s >= 0 ? wait_s * 1000 : undefined);
}

/** Reads at most `limit` bytes. @throws FetchError for more */
async function readBytes({ body, status, headers }: Response, limit: number, where: string, stop: () => void): Promise<ArrayBuffer> {
  const tooLarge = (size: string): FetchError => {
    stop();
    return new FetchError(`${where}: the answer has ${size} bytes, the limit is ${String(limit)}`, status);
  };
  if (Number(headers.get("Content-Length") ?? 0) > limit) throw tooLarge(headers.get("Content-Length") ?? "");
  const parts: Uint8Array<ArrayBuffer>[] = [];
  let size = 0;
  const reader = body?.getReader();
  for (let step = await reader?.read(); step?.value; step = await reader?.read()) {
    size += step.value.length;
    if (size > limit) throw tooLarge(`more than ${String(limit)}`);
    parts.push(step.value);
  }
  return new Blob(parts).arrayBuffer();
}

const isXml = (contentType: string, bytes: ArrayBuffer): boolean =>
  /[/+.](xml|se_xml)$/.test(essenceOf(contentType)) || /^\s*<\?xml/.test(new TextDecoder("latin1").decode(bytes.slice(0, 100)));

/** Returns the exception of a report (OGC 15-001r4 §8.4.3; also those of older services); null for another document. */
function findException(bytes: ArrayBuffer, where: string): PortrayalError | null {
  const root = parseXml(bytes, where);
  if (!/^(Service)?ExceptionReport$/.test(root.localName)) return null;
  const exception = [...root.children].find(({ localName }) => /^(Service)?Exception$/.test(localName));
  const code = attributeOf(exception, "exceptionCode") ?? attributeOf(exception, "code") ?? "NoApplicableCode";
  const locator = attributeOf(exception, "locator");
  const text = textOf(exception, 300).replace(/\s+/g, " ");
  return new PortrayalError(
    `${where}: the service answers ${code.slice(0, 60)}${locator ? ` (${locator.slice(0, 60)})` : ""}${text ? `: ${text}` : ""}`,
    code,
  );
}

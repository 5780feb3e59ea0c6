/** map3d-worker: answers from kept areas when the network does not. It changes nothing that is kept. A service worker of one's own may import it. */
import { CACHE, isVersioned, pageKey, partOf, pieceKey, rangeOf, RECORD, tagOf } from "./keys";

interface Waiting extends Event {
  waitUntil(done: Promise<unknown>): void;
}

interface Asked extends Event {
  readonly request: Request;
  respondWith(answer: Promise<Response>): void;
}

interface Scope {
  readonly clients: { claim(): Promise<void> };
  skipWaiting(): Promise<void>;
  addEventListener(type: "install" | "activate", listener: (event: Waiting) => void): void;
  addEventListener(type: "fetch", listener: (event: Asked) => void): void;
}

/** After a failure what is kept is taken at once for a while; and a network that says nothing is waited for no longer than this. */
const [FAILED_MS, PATIENCE_MS, ORDER_MS] = [5000, 4000, 2000] as const;

const scope = globalThis as unknown as Scope;
/** Of archives that the network has answered for: their states. */
const tags = new Map<string, string>();
let failedUntil = 0;
let order: { readonly until: number; readonly names: Promise<string[]> } | undefined;

scope.addEventListener("install", (event) => { event.waitUntil(scope.skipWaiting()); });
scope.addEventListener("activate", (event) => { event.waitUntil(scope.clients.claim()); });
scope.addEventListener("fetch", (event) => {
  const { request } = event;
  if (request.method === "GET" && request.url.startsWith("http") && request.cache !== "only-if-cached") event.respondWith(answer(request));
});

async function answer(request: Request): Promise<Response> {
  // Somebody wants to know what the network has now.
  if (request.cache === "reload" && request.mode !== "navigate") return fetch(request);
  const range = rangeOf(request.headers);
  if (range !== undefined) return piece(request, range);
  if (isVersioned(request.url)) return (await kept(request.url)) ?? fetch(request);
  return networkFirst(request, () => kept(request.mode === "navigate" ? pageKey(request.url) : withoutHash(request.url)));
}

/** A part of an archive: kept ones hold as long as the archive is the same; without the network they go together anyway. */
async function piece(request: Request, range: string): Promise<Response> {
  const url = withoutHash(request.url);
  const found = await kept(pieceKey(url, range));
  const tag = found && tagOf(found.headers);
  if (found && tag && tag === tags.get(url)) return partOf(found, range);
  const made = await networkFirst(request, () => Promise.resolve(found));
  if (made === found) return partOf(found, range);
  if (made.status === 206) tags.set(url, tagOf(made.headers));
  return made;
}

/** The network's answer, unless there is none, or none in time, and something is kept. */
async function networkFirst(request: Request, find: () => Promise<Response | undefined>): Promise<Response> {
  if (Date.now() < failedUntil) {
    const found = await find();
    if (found) return found;
  }
  const asked = fetch(request);
  let timer: ReturnType<typeof setTimeout> | undefined;
  const late = new Promise<null>((resolve) => { timer = setTimeout(() => { resolve(null); }, PATIENCE_MS); });
  const got = await Promise.race([asked, late]).catch(() => null);
  clearTimeout(timer);
  if (got && got.status < 500) return got;
  const found = request.signal.aborted ? undefined : await find();
  if (!found) return got ?? asked;
  asked.catch(() => undefined);
  failedUntil = Date.now() + FAILED_MS;
  return found;
}

async function kept(key: string): Promise<Response | undefined> {
  for (const name of await areas()) {
    const found = await caches.match(key, { cacheName: name, ignoreVary: true }); // opening it would make one that was removed
    if (found) return found;
  }
  return undefined;
}

/** Their caches, the latest first: its manifest is the one that counts. */
function areas(): Promise<string[]> {
  const now = Date.now();
  if (!order || now > order.until) order = { until: now + ORDER_MS, names: ordered() };
  return order.names;
}

async function ordered(): Promise<string[]> {
  const names = (await caches.keys()).filter((name) => name.startsWith(CACHE));
  const times = await Promise.all(names.map(async (name) => {
    const record = await caches.match(RECORD, { cacheName: name });
    return record ? ((await record.json()) as { stored: string }).stored : "";
  }));
  return names.map((name, k) => ({ name, time: times[k] ?? "" })).sort((a, b) => (a.time < b.time ? 1 : -1)).map(({ name }) => name);
}

const withoutHash = (url: string): string => url.replace(/#.*$/, "");

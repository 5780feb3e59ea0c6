/** map3d-worker: serves saved areas when the network is unavailable. It never changes them. A page's own service worker can import it. */
import { CACHE, isVersioned, pageKey, rangeResponse, rangeKey, rangeOf, RECORD, tagOf } from "./cacheKeys";

interface LifecycleEvent extends Event {
  waitUntil(done: Promise<unknown>): void;
}

interface RequestEvent extends Event {
  readonly request: Request;
  respondWith(answer: Promise<Response>): void;
}

interface WorkerScope {
  readonly clients: { claim(): Promise<void> };
  skipWaiting(): Promise<void>;
  addEventListener(type: "install" | "activate", listener: (event: LifecycleEvent) => void): void;
  addEventListener(type: "fetch", listener: (event: RequestEvent) => void): void;
}

/** Time after a failure in which the cache is used first, longest wait for the network, and lifetime of the list of areas. */
const [CACHE_FIRST_MS, TIMEOUT_MS, LIST_MS] = [5000, 4000, 2000] as const;

const scope = globalThis as unknown as WorkerScope;
/** Current version of each archive, as the network has reported it. */
const tags = new Map<string, string>();
let cacheFirstUntil = 0;
let cacheList: { readonly until: number; readonly names: Promise<string[]> } | undefined;

scope.addEventListener("install", (event) => event.waitUntil(scope.skipWaiting()));
scope.addEventListener("activate", (event) => event.waitUntil(scope.clients.claim()));
scope.addEventListener("fetch", (event) => {
  const { request } = event;
  if (request.method === "GET" && request.url.startsWith("http") && request.cache !== "only-if-cached") event.respondWith(respond(request));
});

async function respond(request: Request): Promise<Response> {
  // The caller asks for the current state of the network.
  if (request.cache === "reload" && request.mode !== "navigate") return fetch(request);
  const range = rangeOf(request.headers);
  if (range !== undefined) return respondRange(request, range);
  if (isVersioned(request.url)) return (await findCached(request.url)) ?? fetch(request);
  return networkFirst(request, () => findCached(request.mode === "navigate" ? pageKey(request.url) : withoutHash(request.url)));
}

/** Responds with a part of an archive. Cached parts are valid while the archive is unchanged; offline, they all belong to the same version. */
async function respondRange(request: Request, range: string): Promise<Response> {
  const url = withoutHash(request.url);
  const found = await findCached(rangeKey(url, range));
  const tag = found && tagOf(found.headers);
  if (found && tag && tag === tags.get(url)) return rangeResponse(found, range);
  const response = await networkFirst(request, () => Promise.resolve(found));
  if (response === found) return rangeResponse(found, range);
  if (response.status === 206) tags.set(url, tagOf(response.headers));
  return response;
}

/** Returns the network's response, or the cached one if the network fails or does not respond in time. */
async function networkFirst(request: Request, find: () => Promise<Response | undefined>): Promise<Response> {
  if (Date.now() < cacheFirstUntil) {
    const found = await find();
    if (found) return found;
  }
  const pending = fetch(request);
  let timer: ReturnType<typeof setTimeout> | undefined;
  const timeout = new Promise<null>((resolve) => {
    timer = setTimeout(() => resolve(null), TIMEOUT_MS);
  });
  const response = await Promise.race([pending, timeout]).catch(() => null);
  clearTimeout(timer);
  if (response && response.status < 500) return response;
  const found = request.signal.aborted ? undefined : await find();
  if (!found) return response ?? pending;
  pending.catch(() => undefined);
  cacheFirstUntil = Date.now() + CACHE_FIRST_MS;
  return found;
}

async function findCached(key: string): Promise<Response | undefined> {
  for (const name of await listCaches()) {
    const found = await caches.match(key, { cacheName: name, ignoreVary: true }); // open() would create a deleted cache again
    if (found) return found;
  }
  return undefined;
}

/** Names of the area caches, the latest first, since its manifest takes precedence. */
function listCaches(): Promise<string[]> {
  const now = Date.now();
  if (!cacheList || now > cacheList.until) cacheList = { until: now + LIST_MS, names: sortedCaches() };
  return cacheList.names;
}

async function sortedCaches(): Promise<string[]> {
  const names = (await caches.keys()).filter((name) => name.startsWith(CACHE));
  const times = await Promise.all(
    names.map(async (name) => {
      const record = await caches.match(RECORD, { cacheName: name });
      return record ? ((await record.json()) as { stored: string }).stored : "";
    }),
  );
  return names
    .map((name, k) => ({ name, time: times[k] ?? "" }))
    .sort((a, b) => (a.time < b.time ? 1 : -1))
    .map(({ name }) => name);
}

const withoutHash = (url: string): string => url.replace(/#.*$/, "");

import { asError } from "../core/errors";
import { StorageError } from "./offlineCache";

/** Can this page be saved for offline use? Browsers support service workers on https pages and on localhost only. */
export const isOfflineAvailable = (): boolean => isSecureContext && "serviceWorker" in navigator && "caches" in globalThis;

/**
 * Registers the service worker map3d-worker.js, which must be on the page's own host, in its folder or above.
 * @throws StorageError when it cannot be registered
 */
export async function registerWorker(url = "map3d-worker.js"): Promise<ServiceWorkerRegistration> {
  if (!isOfflineAvailable()) throw new StorageError("offline use is not available; the page must be served over https or from localhost");
  try {
    const { scope } = await navigator.serviceWorker.register(new URL(url, document.baseURI));
    if (!location.href.startsWith(scope))
      throw new StorageError(`its scope is ${scope}, which does not contain this page; put it into the page's folder or above`);
    return await navigator.serviceWorker.ready;
  } catch (reason) {
    throw new StorageError(`cannot register ${url}: ${asError(reason).message}`);
  }
}

import { asError } from "../core/errors";
import { StorageError } from "./keeper";

/** Can this page be opened without a network? Browsers have service workers on pages with https, and on localhost. */
export const canKeep = (): boolean => isSecureContext && "serviceWorker" in navigator && "caches" in globalThis;

/**
 * Registers map3d-worker.js, which lies on the page's own host and serves the pages of its folder and below.
 * @throws StorageError where it cannot be
 */
export async function registerWorker(url = "map3d-worker.js"): Promise<ServiceWorkerRegistration> {
  if (!canKeep()) throw new StorageError("this page cannot be kept: browsers have service workers on pages with https, and on localhost");
  try {
    const { scope } = await navigator.serviceWorker.register(new URL(url, document.baseURI));
    if (!location.href.startsWith(scope)) throw new StorageError(`it serves ${scope} only; let it lie in this page's folder or above`);
    return await navigator.serviceWorker.ready;
  } catch (reason) {
    throw new StorageError(`${url} cannot be registered: ${asError(reason).message}`);
  }
}

interface Device {
  readonly onLine?: boolean;
  readonly serviceWorker?: { readonly controller: unknown };
}

const device = (): Device | undefined => (globalThis as { navigator?: Device }).navigator;

/** Whether the device has no network. A server on the same device may answer all the same. */
export const isOffline = (): boolean => device()?.onLine === false;

/** Whether a service worker answers requests, also without a network. */
export const hasServiceWorker = (): boolean => Boolean(device()?.serviceWorker?.controller);

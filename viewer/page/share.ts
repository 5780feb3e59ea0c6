import type { Address } from "./address";
import { byId } from "./dom";
import { toast } from "./messages";
import { say } from "./i18n";

/** A button that passes on the address of what is seen: by the device's own means, else through the clipboard. */
export function bindShare(address: Address): void {
  byId("share").addEventListener("click", () => {
    address.write();
    share(document.title, location.href).catch((reason: unknown) => {
      // Closing the device's dialog is an answer, too.
      if (!(reason instanceof DOMException && reason.name === "AbortError")) toast(`${say("copyThis")}: ${location.href}`);
    });
  });
}

async function share(title: string, url: string): Promise<void> {
  if ("share" in navigator) {
    await navigator.share({ title, url });
    return;
  }
  await (navigator as Navigator).clipboard.writeText(url);
  toast(say("copied"));
}

import type { Permalink } from "./permalink";
import { byId } from "./dom";
import { toast } from "./toast";
import { message } from "./i18n";

/** Binds the button that shares the permalink: with the device's share dialog, or through the clipboard. */
export function bindShare(permalink: Permalink): void {
  byId("share").addEventListener("click", () => {
    permalink.write();
    share(document.title, location.href).catch((reason: unknown) => {
      // An AbortError means that the user closed the dialog.
      if (!(reason instanceof DOMException && reason.name === "AbortError")) toast(`${message("copyLink")}: ${location.href}`);
    });
  });
}

async function share(title: string, url: string): Promise<void> {
  if ("share" in navigator) {
    await navigator.share({ title, url });
    return;
  }
  await (navigator as Navigator).clipboard.writeText(url);
  toast(message("linkCopied"));
}

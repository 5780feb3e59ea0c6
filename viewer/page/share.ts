import type { Permalink } from "./permalink";
import { byId } from "./dom";
import { report } from "./toast";
import { message } from "./i18n";

/** Binds the button that shares the permalink in a dialog. Its script loads with the first use. */
export function bindShare(permalink: Permalink): void {
  byId("share").addEventListener("click", () => {
    permalink.write();
    import("./page-share.js").then(({ openShareDialog }) => openShareDialog(message), report);
  });
}

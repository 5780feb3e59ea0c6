import { message } from "./i18n";

/** Returns the URLs of a parameter of this page's address. Those of other origins need the user's consent, since anyone can write such a link; without it, there are none. */
export function requestedUrls(name: string): string[] {
  const urls = new URLSearchParams(location.search).getAll(name).filter((url) => url !== "");
  const others = urls.filter((href) => Object.assign(document.createElement("a"), { href }).origin !== location.origin);
  return others.length < 1 || confirm(message("foreign").replace("%", others.join(", "))) ? urls : [];
}

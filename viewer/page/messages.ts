import { byId, withText } from "./dom";
import { say } from "./i18n";

const SHOWN = 3;
const LASTS_MS = 12_000;

/** Says what went wrong, for a while. The same words are not said twice at once. */
export function toast(text: string): void {
  const toasts = byId("toasts");
  if ([...toasts.children].some((child) => child.firstElementChild?.textContent === text)) return;
  while (toasts.children.length >= SHOWN) toasts.firstElementChild?.remove();
  const box = withText("div", "", "toast");
  const close = withText("button", say("close"));
  close.type = "button";
  close.addEventListener("click", () => {
    box.remove();
  });
  box.append(withText("p", text), close);
  toasts.append(box);
  setTimeout(() => {
    box.remove();
  }, LASTS_MS);
}

/** Says that there is nothing to show, and why. */
export function fail(title: string, why: string): void {
  document.querySelector(".failed")?.remove();
  const box = withText("div", "", "failed");
  box.setAttribute("role", "alert");
  box.append(withText("h2", title), withText("p", why));
  document.body.append(box);
  byId("head").hidden = true;
}

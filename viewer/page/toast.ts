import { byId, withText } from "./dom";
import { message } from "./i18n";

const MAX_TOASTS = 3;
const DURATION_MS = 12_000;

/** Shows a message for a while, unless the same one is visible already. */
export function toast(text: string): void {
  const toasts = byId("toasts");
  if ([...toasts.children].some((child) => child.firstElementChild?.textContent === text)) return;
  while (toasts.children.length >= MAX_TOASTS) toasts.firstElementChild?.remove();
  const box = withText("div", "", "toast");
  const close = withText("button", message("close"));
  close.type = "button";
  close.addEventListener("click", () => {
    box.remove();
  });
  box.append(withText("p", text), close);
  toasts.append(box);
  setTimeout(() => {
    box.remove();
  }, DURATION_MS);
}

/** Shows an error in place of the map. */
export function showFailure(title: string, reason: string): void {
  document.querySelector(".failed")?.remove();
  const box = withText("div", "", "failed");
  box.setAttribute("role", "alert");
  box.append(withText("h2", title), withText("p", reason));
  document.body.append(box);
  byId("head").hidden = true;
}

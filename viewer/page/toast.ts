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
  close.addEventListener("click", () => box.remove());
  box.append(withText("p", text), close);
  toasts.append(box);
  setTimeout(() => box.remove(), DURATION_MS);
}

/** Causes of errors that have been shown. */
const shown = new Set<string>();

/** The messages of one cause differ by URL. */
const causeOf = (text: string): string => text.replace(/\S*\/\S*/g, "");

/** Shows an error, once for each cause; while the device is offline, says so instead. */
export function report(reason: unknown): void {
  const text = navigator.onLine ? (reason instanceof Error ? reason.message : String(reason)) : message("offline");
  const cause = causeOf(text);
  if (shown.has(cause)) return;
  shown.add(cause);
  toast(text);
}

/** Says once when the network goes, and again the next time. */
export function bindNetwork(): void {
  addEventListener("offline", report);
  addEventListener("online", () => shown.clear());
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

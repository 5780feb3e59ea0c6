import { byId } from "./dom";
import { message } from "./i18n";

/** A day lasts about 20 seconds. */
const HOURS_PER_S = 0.85;
/** A long frame, such as in a hidden tab, does not skip the day. */
const LONGEST_FRAME_MS = 250;
const [PLAY, PAUSE] = ["M8 5l11 7-11 7z", "M8 5v14M16 5v14"];

/** Binds the button that lets the sun move through the day. It stops at dusk, at the next press, and when the slider is used. */
export function bindPlay(time: HTMLInputElement): void {
  const button = byId("play");
  let [playing, last, hour] = [false, 0, 0];
  const toggle = (on: boolean): void => {
    if (on === playing) return;
    playing = on;
    button.querySelector("path")?.setAttribute("d", on ? PAUSE : PLAY);
    button.title = message(on ? "pause" : "playDay");
    button.setAttribute("aria-label", button.title);
    if (!on) return;
    hour = time.valueAsNumber < Number(time.max) ? time.valueAsNumber : Number(time.min);
    last = performance.now();
    requestAnimationFrame(step);
  };
  const step = (now: number): void => {
    if (!playing || time.disabled) {
      toggle(false);
      return;
    }
    hour += (HOURS_PER_S * Math.min(now - last, LONGEST_FRAME_MS)) / 1000;
    last = now;
    const before = time.value;
    time.valueAsNumber = hour;
    if (time.value !== before) time.dispatchEvent(new Event("input"));
    if (hour >= Number(time.max)) toggle(false);
    else requestAnimationFrame(step);
  };
  button.addEventListener("click", () => toggle(!playing));
  time.addEventListener("input", ({ isTrusted }) => {
    if (isTrusted) toggle(false);
  });
}

import type { imageLayer, Light, map } from "./map3d.mjs";
import { byId, inputById } from "./dom";

/** A summer day's sun, simplified: from east over south to west; highest at 13 o'clock. */
export function lightAt(hour: number): Pick<Light, "azimuth_deg" | "altitude_deg"> {
  const day = (hour - 6) / 14;
  return { azimuth_deg: 75 + 210 * day, altitude_deg: 14 + 46 * Math.sin(Math.PI * day) };
}

/** The slider moves the light; it rests while nothing is lit. */
export function bindTime(view: map, layer: imageLayer): void {
  const [time, clock, sun] = [inputById("time"), byId("clock"), byId("sun")];
  time.addEventListener("input", () => {
    const hour = time.valueAsNumber;
    clock.textContent = clockOf(hour);
    time.setAttribute("aria-valuetext", clockOf(hour));
    view.setLight(lightAt(hour));
  });
  byId("modes").addEventListener("change", () => {
    const off = layer.mode !== "lit";
    sun.toggleAttribute("data-off", off);
    time.disabled = off;
  });
}

const clockOf = (hour: number): string => `${String(Math.floor(hour))}:${String(Math.round((hour % 1) * 60)).padStart(2, "0")}`;

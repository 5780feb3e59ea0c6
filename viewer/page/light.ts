import { chooseUtcOffset, computeDaylight, type ImageLayer, type Light, type Map3D, type Rendering } from "./map3d.module.js";
import { findFirstSun } from "../src/geo/firstSun";
import { findDay } from "./day";
import { byId, inputById } from "./dom";
import { introduce } from "./i18n";
import { bindPlay } from "./playSun";

/** Hour of the first picture: long light, and one side of most buildings in the sun. */
export const FIRST_HOUR = 8;

/** A summer sun for scenes of unknown location: from east over south to west, highest at 13:00. */
export function lightAt(hour: number): Pick<Light, "azimuth_deg" | "elevation_deg"> {
  const day = (hour - 6) / 14;
  return { azimuth_deg: 75 + 210 * day, elevation_deg: 14 + 46 * Math.sin(Math.PI * day) };
}

/** Binds the time slider, which moves the light through the selected day. It is disabled while the mode is not lit. */
export function bindLight(view: Map3D, layer: ImageLayer, first?: Date): void {
  const { rendering } = layer;
  if (!rendering) return;
  const [time, sun] = [inputById("time"), byId("sun")];
  if (rendering.json.geographic) bindDay(view, rendering, first);
  else
    time.addEventListener("input", () => {
      showClock(time.valueAsNumber);
      view.setLight(lightAt(time.valueAsNumber));
    });
  bindShadows(view, rendering);
  bindPlay(time);
  byId("modes").addEventListener("change", () => {
    const off = layer.mode !== "lit";
    sun.toggleAttribute("data-off", off);
    time.disabled = (byId("play") as HTMLButtonElement).disabled = off;
  });
}

function bindDay(view: Map3D, rendering: Rendering, requested: Date | undefined): void {
  const [time, day] = [inputById("time"), inputById("day")];
  const zone = (): number =>
    chooseUtcOffset(rendering.json.geographic?.lon_lat[0] ?? 0, -new Date(`${day.value}T12:00`).getTimezoneOffset() / 60);
  const moment = (hour: number): Date => new Date(Date.parse(`${day.value}T00:00Z`) + (hour - zone()) * 3_600_000);
  const show = (hour = time.valueAsNumber): void => {
    if (day.value === "") return;
    showClock(hour);
    view.setTime(moment(hour));
  };
  const setDay = (hour: number): void => {
    if (day.value !== "") showDay(time, rendering, moment);
    time.valueAsNumber = hour;
  };
  byId("days").hidden = day.hidden = false;
  const first = requested ?? firstMoment(rendering);
  day.value = first.toISOString().slice(0, 10);
  // The local date there can be the day before or after.
  const local = new Date(first.getTime() + zone() * 3_600_000);
  day.value = local.toISOString().slice(0, 10);
  let dragged = false;
  time.addEventListener("pointerdown", () => {
    dragged = true;
  });
  time.addEventListener("keydown", () => {
    dragged = false;
  });
  // Dragging moves in steps of 15 minutes, keys and playing in steps of 5 minutes.
  time.addEventListener("input", ({ isTrusted }) => {
    if (dragged && isTrusted) time.valueAsNumber = Math.round(4 * time.valueAsNumber) / 4;
    show();
  });
  day.addEventListener("input", () => {
    setDay(time.valueAsNumber);
    show();
  });
  // The time of a link can be at night, beyond the ends of the slider: the map shows it until the slider moves.
  const hour = local.getUTCHours() + local.getUTCMinutes() / 60;
  setDay(hour);
  show(requested && hour);
}

/** Makes the slider last from dawn to dusk, and marks sunrise and sunset. */
function showDay(time: HTMLInputElement, { json: { geographic } }: Rendering, moment: (hour: number) => Date): void {
  if (!geographic) return;
  const { dawn, dusk, ...sun } = findDay((hour) => computeDaylight(moment(hour), geographic).elevation_deg);
  [time.min, time.max, time.step] = [dawn, dusk, 1 / 12].map(String) as [string, string, string];
  byId("daylight").classList.toggle("located", sun.sunrise !== null && sun.sunset !== null && sun.sunrise < sun.sunset);
  for (const name of ["sunrise", "sunset"] as const) {
    const hour = sun[name];
    byId(name).hidden = hour === null;
    byId(name).title = introduce(name, clockOf(hour ?? 0));
    byId("daylight").style.setProperty(name === "sunrise" ? "--rise" : "--set", String(((hour ?? 0) - dawn) / (dusk - dawn)));
  }
}

/** A morning for which the rendering has shadows; a summer morning if it has none. */
function firstMoment({ json }: Rendering): Date {
  const sun = findFirstSun(
    json.layers.map((layer) => ({ ...layer, suns: layer.suns?.filter(({ time }) => !Number.isNaN(Date.parse(time ?? ""))) ?? [] })),
  );
  if (sun?.time) return new Date(sun.time);
  const [lon, lat] = json.geographic?.lon_lat ?? [0, 0];
  return new Date(Date.UTC(new Date().getFullYear(), lat < 0 ? 11 : 5, 21) + (FIRST_HOUR - lon / 15) * 3_600_000);
}

/** Shows the switch of shadows and occlusion, rendered or found from depth. */
export function showShadowSwitch(): void {
  byId("days").hidden = byId("shading").hidden = false;
}

function bindShadows(view: Map3D, { layers }: Rendering): void {
  const box = inputById("shadows");
  box.checked = view.light.shadows;
  if (["sun", "sun16", "ao"].some((kind) => layers.has(kind))) showShadowSwitch();
  box.addEventListener("change", () => view.setLight({ shadows: box.checked, occlusion: box.checked }));
}

function showClock(hour: number): void {
  const clock = clockOf(hour);
  byId("clock").textContent = clock;
  inputById("time").setAttribute("aria-valuetext", clock);
}

const clockOf = (hour: number): string => {
  const minutes = Math.round(hour * 60);
  return `${String(Math.floor(minutes / 60))}:${String(minutes % 60).padStart(2, "0")}`;
};

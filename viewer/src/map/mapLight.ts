import { checkVector } from "../core/check";
import { UsageError } from "../core/errors";
import { computeDaylight } from "../geo/daylight";
import { DEFAULT_LIGHT, clampLight, type Light } from "../geo/light";
import type { Rendering } from "../geo/manifest";

/** A map's light, and the time that it was set to. */
export class MapLight {
  current: Readonly<Light>;
  /** The time of the light; null when it was not set to a time. */
  time: Date | null = null;

  constructor(light: Partial<Light>) {
    this.current = clampLight({ ...DEFAULT_LIGHT, ...light });
  }

  /** Changes properties of the light; azimuth or elevation end the light of a time. */
  set(light: Partial<Light>): void {
    if (light.azimuth_deg !== undefined || light.elevation_deg !== undefined) this.time = null;
    this.#update(light);
  }

  /** Sets the light to a time at a rendering's position. @throws UsageError when its position on earth is unknown */
  setTime(time: Date, { json }: Rendering): void {
    if (!json.geographic)
      throw new UsageError(`cannot locate rendering "${json.name}" on earth, so the sun's position is unknown; use setLight instead`);
    this.time = time;
    this.#update(computeDaylight(time, json.geographic));
  }

  #update(light: Partial<Light>): void {
    this.current = clampLight({ ...this.current, ...light });
  }
}

/** @throws UsageError for anything but a valid date */
export const checkTime = (time: Date): unknown => checkVector([time instanceof Date ? time.getTime() : NaN], "setTime", "a valid Date", 1);

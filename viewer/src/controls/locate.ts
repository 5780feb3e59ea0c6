import { addPanelButton } from "../core/panelButton";
import { adoptStyles, element, iconButton } from "../core/dom";
import type { Vec2, Vec3 } from "../core/vec";
import { MapLayer, Map3dError, Marker, type Map3D } from "../map3d";
import { AccuracyCircle } from "./accuracyCircle";
import { STYLES } from "./styles";
import { findSurface } from "./findSurface";
import { getControlMessages, type ControlMessages } from "./i18n";

/** Options of `locate`. */
export interface LocateOptions {
  /** BCP 47 tag. Default: the map's. */
  language?: string;
}

/** The user's location. */
export interface Located {
  /** World coordinates, on the surface. */
  readonly position: Vec3;
  readonly lonLat: Vec2;
  readonly accuracy_m: number;
}

/** Events of `locate`. */
export interface LocateEvents {
  /** The location is known and shown. */
  located: Located;
  /** The location is unknown. The message is in the user's language and is shown beside the button, too. */
  error: { error: Error };
}

const TARGET = "M12 5a7 7 0 1 0 0 14 7 7 0 0 0 0-14M12 2v3M12 19v3M2 12h3M19 12h3";
const MESSAGE_MS = 9000;
const TIMEOUT_MS = 15_000;
/** Largest round-trip error of a conversion to the scene's CRS and back; beyond, the position is outside the range of the conversion. */
const TOLERANCE_DEG = 1e-5;

/** A button that shows the user's location: a marker with an accuracy circle. A second press removes them. */
export class Locate extends MapLayer<Map3D, LocateEvents> {
  readonly options: LocateOptions;
  readonly #status = element("p", "map3d-status", { role: "status" });
  readonly #circle = new AccuracyCircle();
  #button = element("button", "");
  #box: HTMLElement | undefined;
  #messages: ControlMessages | undefined;
  #pin: Marker | undefined;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #request = 0;

  constructor(options: LocateOptions = {}) {
    super();
    this.options = options;
  }

  protected onAdd(map: Map3D): void {
    const messages = (this.#messages = getControlMessages(this.options.language ?? map.language));
    adoptStyles(document, STYLES);
    this.#button = iconButton("", messages.locate, TARGET);
    this.#button.setAttribute("aria-pressed", "false");
    this.#button.addEventListener("click", () => this.toggle());
    this.#box = addPanelButton(map, this.#button, this.#status);
  }

  protected onRemove(): void {
    this.clear();
    this.#box?.remove();
  }

  /** Does the same as a press on the button. */
  toggle(): this {
    if (this.#pin ?? this.#button.ariaBusy === "true") return this.clear();
    this.#say("");
    const request = ++this.#request;
    this.#button.ariaBusy = "true";
    this.#locate()
      .then(
        (located) => request === this.#request && this.#show(located),
        (error: unknown) => {
          if (request === this.#request) this.#fail(error as Error);
        },
      )
      .finally(() => {
        if (request === this.#request) this.#button.ariaBusy = "false";
      });
    return this;
  }

  /** Removes the marker and the circle. */
  clear(): this {
    this.#request++;
    this.#button.ariaBusy = "false";
    this.#button.ariaPressed = "false";
    this.#pin?.remove();
    this.#pin = undefined;
    this.#circle.remove();
    this.#say("");
    return this;
  }

  async #locate(): Promise<Located> {
    const [map, messages] = [this.map as Map3D, this.#messages as ControlMessages];
    if (!map.fromLonLat([0, 0])) throw new Map3dError(messages.notGeoreferenced);
    if (!isSecureContext) throw new Map3dError(messages.insecure);
    const { latitude, longitude, accuracy } = (await queryPosition(messages)).coords;
    const lonLat = [longitude, latitude] as const;
    const world = map.fromLonLat(lonLat);
    if (!world || !isOnMap(map, world, lonLat)) throw new Map3dError(messages.outside);
    return { position: await findSurface(map, world), lonLat, accuracy_m: accuracy };
  }

  #show(located: Located): void {
    const [map, messages] = [this.map as Map3D, this.#messages as ControlMessages];
    const { position, accuracy_m } = located;
    this.#button.ariaPressed = "true";
    const metres = Math.round(accuracy_m).toLocaleString(this.options.language ?? map.language);
    this.#pin = new Marker(messages.here(`${metres} m`), position).addTo(map);
    this.#circle.addTo(map, position, accuracy_m);
    const side = Math.min(map.container.clientWidth, map.container.clientHeight);
    const fitZoom = map.zoom + Math.log2((0.35 * side * map.metresPerPixel) / Math.max(accuracy_m, 1));
    map.flyTo(position, Math.min(Math.max(fitZoom, map.zoomLimits[0]), map.zoomLimits[1] - 2));
    this.fire("located", located);
  }

  #fail(error: Error): void {
    this.#say(error.message);
    this.#timer = setTimeout(() => this.#say(""), MESSAGE_MS);
    this.fire("error", { error });
  }

  #say(text: string): void {
    clearTimeout(this.#timer);
    this.#status.textContent = text;
  }
}

/** Asks the browser for the location. @throws Map3dError with a message in the user's language */
function queryPosition(messages: ControlMessages): Promise<GeolocationPosition> {
  return new Promise((resolve, reject) => {
    navigator.geolocation.getCurrentPosition(
      resolve,
      ({ code, PERMISSION_DENIED }) => reject(new Map3dError(code === PERMISSION_DENIED ? messages.denied : messages.unavailable)),
      { enableHighAccuracy: true, timeout: TIMEOUT_MS, maximumAge: 0 },
    );
  });
}

/** Is the position inside a layer's bounding box, and is its conversion accurate? */
function isOnMap(map: Map3D, [x, y]: Vec2, [lon, lat]: Vec2): boolean {
  const roundTrip = map.lonLat([x, y, 0]);
  if (!roundTrip || Math.abs(roundTrip[0] - lon) > TOLERANCE_DEG || Math.abs(roundTrip[1] - lat) > TOLERANCE_DEG) return false;
  return map.layers.some(({ rendering }) => {
    if (!rendering) return false;
    const {
      origin,
      box: [low, high],
    } = rendering.json;
    return [x, y].every((part, k) => part >= (origin[k] ?? 0) + (low[k] ?? 0) && part <= (origin[k] ?? 0) + (high[k] ?? 0));
  });
}

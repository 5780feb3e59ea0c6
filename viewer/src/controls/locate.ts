import { addPanelButton } from "../core/panelButton";
import { adoptStyles, element, iconButton } from "../core/dom";
import type { Vec2, Vec3 } from "../core/vec";
import { MapLayer, Map3dError, marker, type map } from "../map3d";
import { Circle } from "./circle";
import { STYLES } from "./styles";
import { surfaceAt } from "./surface";
import { getControlMessages, type ControlMessages } from "./i18n";

export interface LocateOptions {
  /** BCP 47. Default the map's. */
  language?: string;
}

/** Where the reader is. */
export interface Located {
  readonly position: Vec3;
  readonly lonLat: Vec2;
  readonly accuracy_m: number;
}

export interface LocateEvents {
  located: Located;
  /** Its message is in the reader's language, and shown beside the button, too. */
  error: { error: Error };
}

const TARGET = "M12 5a7 7 0 1 0 0 14 7 7 0 0 0 0-14M12 2v3M12 19v3M2 12h3M19 12h3";
const SHOWN_MS = 9000;
const WAIT_MS = 15_000;
/** Degrees by which the way to the map's coordinates and back may differ; beyond, it does not hold. */
const SAME_DEG = 1e-5;

/** A button that shows where the reader is: a marker with a circle of the accuracy. Pressed again, they go. */
export class locate extends MapLayer<map, LocateEvents> {
  readonly options: LocateOptions;
  readonly #said = element("p", "map3d-status", { role: "status" });
  readonly #circle = new Circle();
  #button = element("button", "");
  #box: HTMLElement | undefined;
  #words: ControlMessages | undefined;
  #pin: marker | undefined;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #asked = 0;

  constructor(options: LocateOptions = {}) {
    super();
    this.options = options;
  }

  protected onAdd(map: map): void {
    const words = (this.#words = getControlMessages(this.options.language ?? map.language));
    adoptStyles(document, STYLES);
    this.#button = iconButton("", words.locate, TARGET);
    this.#button.setAttribute("aria-pressed", "false");
    this.#button.addEventListener("click", () => { this.toggle(); });
    this.#box = addPanelButton(map, this.#button, this.#said);
  }

  protected onRemove(): void {
    this.clear();
    this.#box?.remove();
  }

  /** As if its button had been pressed. */
  toggle(): this {
    if (this.#pin ?? this.#button.ariaBusy === "true") return this.clear();
    this.#say("");
    const at = ++this.#asked;
    this.#button.ariaBusy = "true";
    this.#find().then((place) => at === this.#asked && this.#show(place), (error: unknown) => {
      if (at === this.#asked) this.#failed(error as Error);
    }).finally(() => {
      if (at === this.#asked) this.#button.ariaBusy = "false";
    });
    return this;
  }

  /** Takes marker and circle away. */
  clear(): this {
    this.#asked++;
    this.#button.ariaBusy = "false";
    this.#button.ariaPressed = "false";
    this.#pin?.remove();
    this.#pin = undefined;
    this.#circle.remove();
    this.#say("");
    return this;
  }

  async #find(): Promise<Located> {
    const [map, words] = [this.map as map, this.#words as ControlMessages];
    if (!map.fromLonLat([0, 0])) throw new Map3dError(words.placeless);
    if (!isSecureContext) throw new Map3dError(words.insecure);
    const { latitude, longitude, accuracy } = (await positionOf(words)).coords;
    const lonLat = [longitude, latitude] as const;
    const world = map.fromLonLat(lonLat);
    if (!world || !within(map, world, lonLat)) throw new Map3dError(words.outside);
    return { position: await surfaceAt(map, world), lonLat, accuracy_m: accuracy };
  }

  #show(place: Located): void {
    const [map, words] = [this.map as map, this.#words as ControlMessages];
    const { position, accuracy_m } = place;
    this.#button.ariaPressed = "true";
    const metres = Math.round(accuracy_m).toLocaleString(this.options.language ?? map.language);
    this.#pin = new marker(words.here(`${metres} m`), position).addTo(map);
    this.#circle.addTo(map, position, accuracy_m);
    const side = Math.min(map.container.clientWidth, map.container.clientHeight);
    const seenWhole = map.zoom + Math.log2((0.35 * side * map.metresPerPixel) / Math.max(accuracy_m, 1));
    map.flyTo(position, Math.min(Math.max(seenWhole, map.zoomLimits[0]), map.zoomLimits[1] - 2));
    this.fire("located", place);
  }

  #failed(error: Error): void {
    this.#say(error.message);
    this.#timer = setTimeout(() => { this.#say(""); }, SHOWN_MS);
    this.fire("error", { error });
  }

  #say(text: string): void {
    clearTimeout(this.#timer);
    this.#said.textContent = text;
  }
}

/** @throws Map3dError in the reader's words */
function positionOf(words: ControlMessages): Promise<GeolocationPosition> {
  return new Promise((resolve, reject) => {
    navigator.geolocation.getCurrentPosition(resolve, ({ code, PERMISSION_DENIED }) => {
      reject(new Map3dError(code === PERMISSION_DENIED ? words.denied : words.unavailable));
    }, { enableHighAccuracy: true, timeout: WAIT_MS, maximumAge: 0 });
  });
}

/** Is it in the box of a layer, and near enough that the coordinates hold? */
function within(map: map, [x, y]: Vec2, [lon, lat]: Vec2): boolean {
  const back = map.lonLat([x, y, 0]);
  if (!back || Math.abs(back[0] - lon) > SAME_DEG || Math.abs(back[1] - lat) > SAME_DEG) return false;
  return map.layers.some(({ rendering }) => {
    if (!rendering) return false;
    const { origin, box: [low, high] } = rendering.json;
    return [x, y].every((part, k) => part >= (origin[k] ?? 0) + (low[k] ?? 0) && part <= (origin[k] ?? 0) + (high[k] ?? 0));
  });
}

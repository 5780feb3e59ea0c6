import { addPanelButton } from "../core/panelButton";
import { adoptStyles, element, iconButton } from "../core/dom";
import { add, dot, sub, type Box3, type Vec2 } from "../core/vec";
import { MapLayer, map } from "../map3d";
import { STYLES } from "./styles";
import { getControlMessages } from "./i18n";

/** Of an `overview`. */
export interface OverviewOptions {
  /** Only its button is shown at first. Default: on maps that are narrower than 640 CSS pixels. */
  collapsed?: boolean;
  /** BCP 47. Default the map's. */
  language?: string;
}

const NARROW_PX = 640;
/** Less is a tap. */
const TAP_PX = 4;
const STEP = 0.25;
const SHEET = "M3 6l6-2 6 2 6-2v14l-6 2-6-2-6 2zM9 4v14M15 6v14";
const KEYS: Record<string, Vec2> = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** A small map of the whole with a frame around what is seen, which can be dragged; a click goes there. */
export class overview extends MapLayer<map, object> {
  readonly options: OverviewOptions;
  readonly #pane = element("div", "map3d-overview-map");
  readonly #hand = element("div", "map3d-overview-hand", { tabindex: "0", role: "group" });
  readonly #frame = element("div", "map3d-overview-frame");
  #button = element("button", "");
  #box: HTMLElement | undefined;
  #small: map | undefined;
  #ending = new AbortController();

  constructor(options: OverviewOptions = {}) {
    super();
    this.options = options;
  }

  protected onAdd(map: map): void {
    this.#ending = new AbortController();
    const words = getControlMessages(this.options.language ?? map.language);
    adoptStyles(document, STYLES);
    this.#hand.setAttribute("aria-label", words.move);
    this.#hand.replaceChildren(this.#frame);
    this.#button = iconButton("", words.overview, SHEET);
    this.#button.addEventListener("click", () => { this.toggle(); });
    this.#box = addPanelButton(map, this.#button, this.#pane);
    map.frameEvents.on("move", this.#follow);
    map.on("directionchange", this.#turn);
    map.on("lightchange", this.#relight);
    map.on("ready", this.#open);
    this.#steer();
    this.toggle(!(this.options.collapsed ?? map.container.clientWidth < NARROW_PX));
  }

  protected onRemove(map: map): void {
    this.#ending.abort();
    this.toggle(false);
    map.frameEvents.off("move", this.#follow);
    map.off("directionchange", this.#turn);
    map.off("lightchange", this.#relight);
    map.off("ready", this.#open);
    this.#box?.remove();
  }

  /** Is the small map shown? */
  get open(): boolean {
    return !this.#pane.hidden;
  }

  /** Opens or closes it. */
  toggle(open = !this.open): this {
    this.#pane.hidden = !open;
    this.#button.setAttribute("aria-expanded", String(open));
    if (open) this.#open();
    else this.#close();
    return this;
  }

  readonly #open = (): void => {
    const shown = this.map;
    if (!shown?.getViewState() || this.#small || !this.open) return;
    const place = this.#pane.appendChild(element("div", ""));
    const small = new map(place, { controls: false, attribution: false, direction: shown.direction, light: shown.light, cacheBytes: 16e6, workers: 1, maxPixelRatio: 2, ...(shown.drawer && { drawer: shown.drawer }) });
    [place.inert, place.tabIndex] = [true, -1];
    this.#pane.append(this.#hand);
    this.#small = small;
    small.on("error", () => undefined); // the large map says what is wrong
    small.on("ready", () => { this.#turn(); });
    small.frameEvents.on("move", this.#follow);
    for (const layer of shown.layers) layer.copy().setStyle({}).clearHighlight().addTo(small);
  };

  #close(): void {
    this.#small?.remove();
    this.#small = undefined;
    this.#pane.replaceChildren();
  }

  /** The whole, from where the map looks. */
  readonly #turn = (): void => {
    const rendering = this.map?.layers.find((layer) => layer.rendering)?.rendering;
    if (!this.map || !rendering || !this.#small?.getViewState()) return;
    const { origin, box: [low, high] } = rendering.json;
    const whole: Box3 = [add(origin, low), add(origin, high)];
    this.#small.setDirection(this.map.direction).fitBounds(whole, { padding_px: 6 });
    this.#follow();
  };

  readonly #relight = (): void => {
    if (this.map) this.#small?.setLight(this.map.light);
  };

  /** Puts the frame around what the map shows. */
  readonly #follow = (): void => {
    const [shown, small] = [this.map?.getViewState(), this.#small?.getViewState()];
    if (!shown || !small) return;
    const { right, up } = shown.camera.frame.axes;
    const shift = sub(shown.origin, small.origin);
    const px_m = (this.#small as map).metresPerPixel;
    const across = (this.map as map).metresPerPixel / px_m;
    const x = (shown.camera.u + dot(right, shift) - small.camera.u) / px_m + small.camera.width / 2;
    const y = (small.camera.v - shown.camera.v - dot(up, shift)) / px_m + small.camera.height / 2;
    const [width, height] = [shown.camera.width * across, shown.camera.height * across];
    Object.assign(this.#frame.style, { width: `${width.toFixed(1)}px`, height: `${height.toFixed(1)}px`, transform: `translate(${(x - width / 2).toFixed(1)}px, ${(y - height / 2).toFixed(1)}px)` });
  };

  #steer(): void {
    const { signal } = this.#ending;
    let hand: { at: Vec2; moved: boolean } | null = null;
    this.#hand.addEventListener("pointerdown", ({ button, pointerId, target, clientX, clientY }) => {
      if (button !== 0) return;
      this.#hand.setPointerCapture(pointerId);
      this.map?.startGesture();
      hand = { at: [clientX, clientY], moved: target !== this.#frame };
      if (hand.moved) this.#goTo(hand.at);
    }, { signal });
    this.#hand.addEventListener("pointermove", ({ clientX, clientY }) => {
      if (!hand || (!hand.moved && Math.hypot(clientX - hand.at[0], clientY - hand.at[1]) < TAP_PX)) return;
      this.#shift(clientX - hand.at[0], clientY - hand.at[1], false);
      hand = { at: [clientX, clientY], moved: true };
    }, { signal });
    this.#hand.addEventListener("pointerup", () => {
      if (hand && !hand.moved) this.#goTo(hand.at);
      hand = null;
    }, { signal });
    this.#hand.addEventListener("pointercancel", () => { hand = null; }, { signal });
    this.#hand.addEventListener("keydown", (event) => {
      const step = KEYS[event.key];
      if (!step || !this.map) return;
      event.preventDefault();
      const { clientWidth, clientHeight } = this.map.container;
      this.map.panBy(step[0] * STEP * clientWidth, step[1] * STEP * clientHeight, { smooth: true });
    }, { signal });
  }

  #goTo([x, y]: Vec2): void {
    const { left, top, width, height } = this.#frame.getBoundingClientRect();
    this.#shift(x - left - width / 2, y - top - height / 2, true);
  }

  /** Moves what is seen by pixels of the small map. */
  #shift(dx: number, dy: number, smooth: boolean): void {
    if (!this.map || !this.#small) return;
    const times = this.#small.metresPerPixel / this.map.metresPerPixel;
    this.map.panBy(-dx * times, -dy * times, { smooth });
  }
}

import { addPanelButton } from "../core/panelButton";
import { adoptStyles, element, iconButton, positionIn } from "../core/dom";
import { add, dot, sub, type Box3, type Vec2 } from "../core/vec";
import { MapLayer, Map3D } from "../map3d";
import { STYLES } from "./styles";
import { getControlMessages } from "./i18n";

/** Options of `overview`. */
export interface OverviewOptions {
  /** Starts closed, with only the button visible. Default: true on maps narrower than 640 CSS pixels. */
  collapsed?: boolean;
  /** BCP 47 tag. Default: the map's. */
  language?: string;
}

const NARROW_PX = 640;
/** A shorter movement is a tap. */
const TAP_PX = 4;
const STEP = 0.25;
const ICON = "M3 6l6-2 6 2 6-2v14l-6 2-6-2-6 2zM9 4v14M15 6v14";
const KEYS: Record<string, Vec2> = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** A small map of the whole scene with a frame around the current view. Drag the frame, or click to move there. */
export class Overview extends MapLayer<Map3D, object> {
  readonly options: OverviewOptions;
  readonly #pane = element("div", "map3d-overview-map");
  readonly #pad = element("div", "map3d-overview-pad", { tabindex: "0", role: "group" });
  readonly #frame = element("div", "map3d-overview-frame");
  #button = element("button", "");
  #box: HTMLElement | undefined;
  #small: Map3D | undefined;
  /** Middle of the frame, CSS pixels of the pad. */
  #center: Vec2 = [0, 0];
  #listeners = new AbortController();

  constructor(options: OverviewOptions = {}) {
    super();
    this.options = options;
  }

  protected onAdd(map: Map3D): void {
    this.#listeners = new AbortController();
    const messages = getControlMessages(this.options.language ?? map.language);
    adoptStyles(document, STYLES);
    this.#pad.setAttribute("aria-label", messages.move);
    this.#pad.replaceChildren(this.#frame);
    this.#button = iconButton("", messages.overview, ICON);
    this.#button.addEventListener("click", () => this.toggle());
    this.#box = addPanelButton(map, this.#button, this.#pane);
    map.frameEvents.on("move", this.#placeFrame);
    map.on("directionchange", this.#fit);
    map.on("lightchange", this.#copyLight);
    map.on("ready", this.#create);
    this.#bindPointer();
    this.toggle(!(this.options.collapsed ?? map.container.clientWidth < NARROW_PX));
  }

  protected onRemove(map: Map3D): void {
    this.#listeners.abort();
    this.toggle(false);
    map.frameEvents.off("move", this.#placeFrame);
    map.off("directionchange", this.#fit);
    map.off("lightchange", this.#copyLight);
    map.off("ready", this.#create);
    this.#box?.remove();
  }

  /** True while the small map is visible. */
  get open(): boolean {
    return !this.#pane.hidden;
  }

  /** Opens or closes the small map. */
  toggle(open = !this.open): this {
    this.#pane.hidden = !open;
    this.#button.setAttribute("aria-expanded", String(open));
    if (open) this.#create();
    else this.#destroy();
    return this;
  }

  readonly #create = (): void => {
    const shown = this.map;
    if (!shown?.getViewState() || this.#small || !this.open) return;
    const box = this.#pane.appendChild(element("div", ""));
    const small = new Map3D(box, {
      controls: false,
      attribution: false,
      direction: shown.direction,
      light: shown.light,
      cacheBytes: 16e6,
      workers: 1,
      ...(shown.drawer && { drawer: shown.drawer }),
    });
    [box.inert, box.tabIndex] = [true, -1];
    this.#pane.append(this.#pad);
    this.#small = small;
    small.on("error", () => undefined); // the large map reports the same errors
    small.on("ready", () => this.#fit());
    small.frameEvents.on("move", this.#placeFrame);
    for (const layer of shown.layers) layer.copy().setStyle({}).clearHighlight().addTo(small);
  };

  #destroy(): void {
    this.#small?.remove();
    this.#small = undefined;
    this.#pane.replaceChildren();
  }

  /** Shows the whole scene in the direction of the map. */
  readonly #fit = (): void => {
    const rendering = this.map?.layers.find((layer) => layer.rendering)?.rendering;
    if (!this.map || !rendering || !this.#small?.getViewState()) return;
    const {
      origin,
      box: [low, high],
    } = rendering.json;
    const whole: Box3 = [add(origin, low), add(origin, high)];
    this.#small.setDirection(this.map.direction).fitBounds(whole, { padding_px: 6 });
    this.#placeFrame();
  };

  readonly #copyLight = (): void => {
    if (this.map) this.#small?.setLight(this.map.light);
  };

  /** Places the frame around the map's view. */
  readonly #placeFrame = (): void => {
    const [shown, small] = [this.map?.getViewState(), this.#small?.getViewState()];
    if (!shown || !small) return;
    const { right, up } = shown.camera.frame.axes;
    const shift = sub(shown.origin, small.origin);
    const px_m = (this.#small as Map3D).metresPerPixel;
    const scale = (this.map as Map3D).metresPerPixel / px_m;
    const x = (shown.camera.u + dot(right, shift) - small.camera.u) / px_m + small.camera.width / 2;
    const y = (small.camera.v - shown.camera.v - dot(up, shift)) / px_m + small.camera.height / 2;
    this.#center = [x, y];
    const [width, height] = [shown.camera.width * scale, shown.camera.height * scale];
    Object.assign(this.#frame.style, {
      width: `${width.toFixed(1)}px`,
      height: `${height.toFixed(1)}px`,
      transform: `translate(${(x - width / 2).toFixed(1)}px, ${(y - height / 2).toFixed(1)}px)`,
    });
  };

  #bindPointer(): void {
    const { signal } = this.#listeners;
    let drag: { at: Vec2; moved: boolean } | null = null;
    this.#pad.addEventListener(
      "pointerdown",
      (event) => {
        if (event.button !== 0) return;
        this.#pad.setPointerCapture(event.pointerId);
        this.map?.startGesture();
        drag = { at: positionIn(this.#pad, event), moved: event.target !== this.#frame };
        if (drag.moved) this.#goTo(drag.at);
      },
      { signal },
    );
    this.#pad.addEventListener(
      "pointermove",
      (event) => {
        if (!drag) return;
        const at = positionIn(this.#pad, event);
        const [dx, dy] = [at[0] - drag.at[0], at[1] - drag.at[1]];
        if (!drag.moved && Math.hypot(dx, dy) < TAP_PX) return;
        this.#shift(dx, dy, false);
        drag = { at, moved: true };
      },
      { signal },
    );
    this.#pad.addEventListener(
      "pointerup",
      () => {
        if (drag && !drag.moved) this.#goTo(drag.at);
        drag = null;
      },
      { signal },
    );
    this.#pad.addEventListener(
      "pointercancel",
      () => {
        drag = null;
      },
      { signal },
    );
    this.#pad.addEventListener(
      "keydown",
      (event) => {
        const step = KEYS[event.key];
        if (!step || !this.map) return;
        event.preventDefault();
        const { clientWidth, clientHeight } = this.map.container;
        this.map.panBy(step[0] * STEP * clientWidth, step[1] * STEP * clientHeight, { smooth: true });
      },
      { signal },
    );
  }

  #goTo([x, y]: Vec2): void {
    this.#shift(x - this.#center[0], y - this.#center[1], true);
  }

  /** Pans the map by pixels of the small map. */
  #shift(dx: number, dy: number, smooth: boolean): void {
    if (!this.map || !this.#small) return;
    const scale = this.#small.metresPerPixel / this.map.metresPerPixel;
    this.map.panBy(-dx * scale, -dy * scale, { smooth });
  }
}

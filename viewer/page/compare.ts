import { Map3D, type ClickEvent, type ImageLayer } from "./map3d.module.js";
import { Haze } from "./haze";
import { byId } from "./dom";
import { report } from "./toast";

/** Facing north, east, south and west where the first map faces north. */
const TURNS_DEG = [0, 270, 180, 90];
/** Four maps have a quarter of the screen each: one zoom level less shows the same ground. */
const ZOOM_OUT = -1;

/** The view to compare with others around the same place. */
export interface CompareContext {
  readonly view: Map3D;
  /** Selects what was clicked in any of the maps. */
  readonly onClick: (event: ClickEvent) => void;
  /** Whether each map fades towards the edge of its content. */
  readonly hasHaze: boolean;
}

/** Shows the view in four directions at once: the page's map and three more, which move together. */
export class Compare {
  readonly #context: CompareContext;
  readonly #pitch_deg: number | undefined;
  readonly #others: Map3D[] = [];
  /** The layers of the page, and their copies in the other maps. */
  readonly #copies: (readonly [layer: ImageLayer, copy: ImageLayer])[] = [];
  #end: (() => void) | undefined;

  constructor(context: CompareContext) {
    this.#context = context;
    const pitches = context.view.directions.map(({ pitch_deg }) => pitch_deg);
    this.#pitch_deg = pitches.find((pitch) => pitches.filter((other) => other === pitch).length >= TURNS_DEG.length);
    byId("compare").hidden = this.#pitch_deg === undefined;
    byId("compare").addEventListener("click", () => void this.#open().catch(report));
    byId("end-compare").addEventListener("click", () => this.#close());
    addEventListener("keydown", ({ key }) => {
      if (key === "Escape" && !document.querySelector("dialog[open]")) this.#close();
    });
    context.view.on("lightchange", () => this.#light());
  }

  /** Highlights in all maps what is highlighted in the page's. */
  highlight(): void {
    for (const [layer, copy] of this.#copies) copy.clearHighlight().highlight(layer.highlighted);
  }

  async #open(): Promise<void> {
    const { view } = this.#context;
    const { Sync } = await import("./map3d-compare.module.js");
    if (this.#end) return;
    document.body.classList.add("compares");
    const shown = view.directions.find(({ id }) => id === view.direction);
    if (shown?.pitch_deg !== this.#pitch_deg)
      view.setDirection(view.directions.find(({ pitch_deg }) => pitch_deg === this.#pitch_deg)?.id ?? view.direction);
    for (let k = 1; k < TURNS_DEG.length; k++) this.#others.push(this.#addMap());
    this.#light();
    this.highlight();
    const zoom = view.zoom;
    view.setZoom(zoom + ZOOM_OUT);
    const zoomed = view.zoom - zoom;
    const together = new Sync([view, ...this.#others], { turns_deg: TURNS_DEG, captions: true });
    this.#end = () => {
      together.remove();
      view.setZoom(view.zoom - zoomed);
    };
    byId("end-compare").focus();
  }

  #close(): void {
    if (!this.#end) return;
    this.#end();
    this.#end = undefined;
    this.#copies.length = 0;
    for (const other of this.#others.splice(0)) {
      const { container } = other;
      other.remove();
      container.remove();
    }
    document.body.classList.remove("compares");
    byId("compare").focus();
  }

  /** Adds a map with copies of the page's layers. */
  #addMap(): Map3D {
    const { view, onClick, hasHaze } = this.#context;
    const box = document.createElement("div");
    box.className = "compared";
    view.container.parentElement?.append(box);
    const { center, zoom, direction, light, drawer, options } = view;
    const other = new Map3D(box, {
      ...(center && { center }),
      zoom,
      direction,
      light,
      ...(drawer && { drawer }),
      dataSaver: options.dataSaver,
      controls: false,
      scaleBar: false,
      attribution: false,
    });
    other.on("error", ({ error }) => report(error)).on("click", (event) => onClick(event));
    for (const layer of view.layers) {
      const copy = layer.copy();
      this.#copies.push([layer, copy.addTo(other)]);
    }
    const [first] = other.layers;
    other.whenReady(() => {
      if (hasHaze && first) new Haze(other, first);
      if (first?.rendering?.layers.has("depth") && !options.dataSaver)
        import("./map3d-shade.module.js").then(({ Shade }) => {
          new Shade().addTo(other);
        }, report);
    });
    return other;
  }

  #light(): void {
    for (const other of this.#others) other.setLight(this.#context.view.light);
  }
}

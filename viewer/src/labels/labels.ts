import { adoptStyles, element, iconButton } from "../core/dom";
import { asError } from "../core/errors";
import { addPanelButton } from "../core/panelButton";
import { sub, type Vec2, type Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import { findHeight, MapLayer, type ImageLayer, type Map3D, type ObjectInfo, type VisibleDepths } from "../map3d";
import { labelFeatures, nameOf, type LabelledFeature } from "./fromGeoJson";
import { nameOfObject, ObjectLabels } from "./fromLayer";
import { getLabelsMessage } from "./i18n";
import type { Label } from "./label";
import { chooseLabels, type LabelBox } from "./layout";
import { STYLES } from "./styles";

/** Options of `labels`. */
export interface LabelsOptions {
  /** Text of an object of a layer; "" for none. Default: its attribute `name`, else its name, unless that is an identifier. */
  objectName?: (object: ObjectInfo, id: number) => string;
  /** Text of a feature of GeoJSON; "" for none. Default: its property `name`. */
  featureName?: (feature: LabelledFeature) => string;
  /** Adds a button that shows and hides the labels. Default true. */
  button?: boolean;
  /** Shows the labels at first. Default true. */
  shown?: boolean;
}

/** Events of `labels`. */
export interface LabelsEvents {
  /** The labels were shown or hidden. */
  toggle: { shown: boolean };
  /** Names could not be read. The map fires "error", too. */
  error: { error: Error };
}

/** A label on the map. */
interface Placed {
  readonly label: Label;
  readonly element: HTMLElement;
  readonly width: number;
  /** World coordinates in this direction; null: hidden; undefined: not known yet. */
  place: Vec3 | null | undefined;
  shown: boolean;
}

/** The labels of each map, which leave room for each other. */
const peers = new WeakMap<Map3D, Set<Labels>>();

const ICON = "M5 19L11 5h2l6 14M7.5 14h9";
const HEIGHT_PX = 16;
/** Labels this far outside the screen are placed, so that they are there when they come into view. */
const MARGIN_PX = 120;
/** Distance of the text above its place. */
const RISE_PX = 4;

/** Shows names at their places: of a layer's objects, or of GeoJSON. Labels behind buildings are hidden, and none overlap. */
export class Labels extends MapLayer<Map3D, LabelsEvents> {
  readonly needs = ["depth"] as const;
  readonly options: LabelsOptions;
  readonly #source: ImageLayer | string | object;
  readonly #pane = element("div", "map3d-labels", { "aria-hidden": "true" });
  readonly #pen = document.createElement("canvas").getContext("2d");
  #placed = new Map<string, Placed>();
  #objects: ObjectLabels | undefined;
  #button: HTMLElement | undefined;
  #direction = "";
  #shown: boolean;

  /** @param source an image layer, a URL of GeoJSON, or a FeatureCollection */
  constructor(source: ImageLayer | string | object, options: LabelsOptions = {}) {
    super();
    [this.#source, this.options, this.#shown] = [source, options, options.shown ?? true];
  }

  protected override get eventTypes(): readonly (keyof LabelsEvents)[] {
    return ["toggle", "error"];
  }

  /** Whether the labels are shown. */
  get shown(): boolean {
    return this.#shown;
  }

  /** Texts of the labels that are visible now. */
  get visible(): readonly string[] {
    return [...this.#placed.values()].filter(({ shown }) => shown && this.#shown).map(({ label }) => label.text);
  }

  /** Shows or hides all labels. */
  toggle(shown = !this.#shown): this {
    this.#shown = shown;
    this.#pane.hidden = !shown;
    this.#button?.querySelector("button")?.setAttribute("aria-pressed", String(shown));
    if (this.map) this.#start(this.map);
    return this.fire("toggle", { shown });
  }

  protected onAdd(map: Map3D): void {
    adoptStyles(document, STYLES);
    map.overlayPane.prepend(this.#pane);
    peers.set(map, (peers.get(map) ?? new Set()).add(this));
    if (this.options.button ?? true) this.#addButton(map);
    map.frameEvents.on("move", this.#move);
    map.frameEvents.on("draw", this.#draw);
    map.on("idle", this.#rest);
    this.toggle(this.#shown);
  }

  protected onRemove(map: Map3D): void {
    map.frameEvents.off("move", this.#move);
    map.frameEvents.off("draw", this.#draw);
    map.off("idle", this.#rest);
    peers.get(map)?.delete(this);
    this.#button?.remove();
    this.#pane.replaceChildren();
    this.#pane.remove();
    this.#placed.clear();
    this.#objects = undefined;
  }

  #addButton(map: Map3D): void {
    const button = iconButton("", getLabelsMessage(map.language), ICON);
    button.addEventListener("click", () => this.toggle());
    this.#button = addPanelButton(map, button, element("span", "map3d-status"));
  }

  /** Reads the names, once they are wanted. */
  #start(map: Map3D): void {
    if (!this.#shown) return;
    const source = this.#source;
    const { objectName = nameOfObject, featureName = nameOf } = this.options;
    if (typeof source === "object" && "setStyle" in source) {
      this.#objects ??= new ObjectLabels(source, objectName);
      if (map.loaded()) this.#rest();
    } else if (this.#placed.size === 0) {
      map.whenReady(() => {
        this.#run(map, async () =>
          labelFeatures(typeof source === "string" ? await (await fetch(source)).json() : source, featureName, (lonLat) =>
            map.fromLonLat(lonLat),
          ),
        );
      });
    }
  }

  #run(map: Map3D, read: () => Promise<readonly Label[]>): void {
    read()
      .then((list) => {
        if (this.map === map) this.#add(list);
      })
      .catch((reason: unknown) => {
        if (this.map !== map) return;
        this.fire("error", { error: asError(reason) });
        map.report(asError(reason));
      });
  }

  #add(list: readonly Label[]): void {
    const font = getComputedStyle(this.#pane).fontFamily;
    for (const label of list) {
      const key = `${label.text} ${label.positions[0].join(" ")}`;
      if (this.#placed.has(key)) continue;
      const text = element("span", `map3d-label${label.line ? " map3d-label-line" : ""}`, {}, label.text);
      if (this.#pen) this.#pen.font = `600 13px ${font}`;
      this.#placed.set(key, {
        label,
        element: text,
        width: this.#pen?.measureText(label.text).width ?? 8 * label.text.length,
        place: undefined,
        shown: false,
      });
    }
    this.#draw();
  }

  /** At rest, everything in view is known exactly: reads names and judges all places again. */
  readonly #rest = (): void => {
    const [map, objects] = [this.map, this.#objects];
    if (!map || !this.#shown) return;
    this.#layOut(map, true);
    if (objects) this.#run(map, () => objects.read(map));
  };

  readonly #draw = (): void => {
    if (this.map && this.#shown) this.#layOut(this.map, false);
  };

  /** Moves the labels with the picture. */
  readonly #move = (): void => {
    const map = this.map;
    if (!map || !this.#shown) return;
    for (const { place, element, shown, width } of this.#placed.values()) {
      const at = shown && place ? map.project(place) : null;
      if (at) element.style.transform = `translate(${(at[0] - width / 2).toFixed(1)}px, ${(at[1] - HEIGHT_PX - RISE_PX).toFixed(1)}px)`;
    }
  };

  /** Chooses the labels to show. @param again judges places again that are known from coarser tiles */
  #layOut(map: Map3D, again: boolean): void {
    const relief = map.visibleDepths;
    if (!relief || map.inTransition) return;
    if (map.direction !== this.#direction) for (const each of this.#placed.values()) each.place = undefined;
    this.#direction = map.direction;
    const near: { each: Placed; at: Vec2 }[] = [];
    for (const each of this.#placed.values()) {
      const at = this.#findOnScreen(map, each.place ?? each.label.positions[0]);
      const judged = at && (again || each.place === undefined) ? judgeAll(relief, each.label.positions) : undefined;
      if (judged !== undefined) each.place = judged;
      if (at && each.place) near.push({ each, at: map.project(each.place) ?? at });
      else this.#show(each, false);
    }
    const others = [...(peers.get(map) ?? [])].flatMap((peer) => (peer === this ? [] : peer.#listBoxes(map)));
    const own = near.map(({ each, at }) => boxOf(each, at));
    const chosen = chooseLabels([...others, ...own]).slice(others.length);
    near.forEach(({ each }, k) => this.#show(each, chosen[k] === true));
    this.#move();
  }

  /** Lists the boxes of the labels that are visible: they stay. */
  #listBoxes(map: Map3D): LabelBox[] {
    const visible = [...this.#placed.values()].filter(({ shown }) => shown && this.#shown);
    return visible.flatMap((each) => {
      const at = each.place && map.project(each.place);
      return at ? [{ ...boxOf(each, at), rank: Infinity }] : [];
    });
  }

  /** Returns where a place is on the screen; null if it is far outside. */
  #findOnScreen(map: Map3D, [x, y, z]: Vec3): Vec2 | null {
    const at = map.project(Number.isNaN(z) ? { xy: [x, y] } : [x, y, z]);
    const { clientWidth, clientHeight } = map.container;
    return at && at[0] > -MARGIN_PX && at[1] > -MARGIN_PX && at[0] < clientWidth + MARGIN_PX && at[1] < clientHeight + MARGIN_PX
      ? at
      : null;
  }

  #show(each: Placed, shown: boolean): void {
    if (shown && !each.element.isConnected) this.#pane.append(each.element);
    each.element.classList.toggle("map3d-label-shown", shown);
    each.shown = shown;
  }
}

const boxOf = ({ width, label, shown }: Placed, [x, y]: Vec2): LabelBox => ({ x, y, width, height: HEIGHT_PX, rank: label.rank, shown });

/** Returns the first of several places where a label is visible; null: it is hidden; undefined: depths are not in memory yet. */
function judgeAll(relief: VisibleDepths, positions: readonly Vec3[]): Vec3 | null | undefined {
  const places = positions.map((position) => judge(relief, position));
  return places.find((place) => place) ?? (places.includes(undefined) ? undefined : null);
}

/** Returns where a label is visible; null: it is hidden; undefined: depths are not in memory yet. */
function judge(relief: VisibleDepths, position: Vec3): Vec3 | null | undefined {
  const [x, y, z] = sub(position, relief.origin);
  if (Number.isNaN(z)) {
    const height = findHeight(relief, x, y);
    return height === null ? null : Number.isNaN(height) ? undefined : [position[0], position[1], relief.origin[2] + height];
  }
  const [u, v, d] = uvdFromLocal(relief.camera.frame.axes, [x, y, z]);
  return Number.isNaN(relief.depthAt(u, v)) ? undefined : relief.isOccluded(u, v, d) ? null : position;
}

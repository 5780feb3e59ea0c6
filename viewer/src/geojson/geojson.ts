import { adoptStyles } from "../core/dom";
import { add, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { MapLayer, FetchError, UsageError, type Map3D, type Marker, type VisibleDepths } from "../map3d";
import { FeatureRenderer } from "./featureRenderer";
import { anchorOf, hitTest } from "./hitTest";
import { FeatureList } from "./featureList";
import { readGeojson, type Feature, type FeatureShape, type Skipped } from "./parse";
import { coordinateTransform, worldOf } from "./coordinates";
import { placeFeature, type Occlusion, type PlacedFeature, type FeatureDot } from "./placedFeature";
import { resolveStyle, type FeatureStyle } from "./style";
import { STYLES } from "./styles";
import { getGeojsonMessages } from "./i18n";

export interface GeojsonOptions {
  /** Style of all features, or a function of the feature. Default: see the fields of the style. */
  style?: FeatureStyle | ((feature: Feature) => FeatureStyle);
  /** Returns a marker for a point, or null for a dot. Default: dots. */
  pointToMarker?: (feature: Feature, position: Vec3) => Marker | null;
  /** Returns false for features to leave out. Default: all are shown. */
  filter?: (feature: Feature) => boolean;
  /** Called for each feature that is shown. Default: none. */
  onEachFeature?: (feature: Feature) => void;
  /** Parts behind buildings: hidden, pale and dashed, or drawn as if nothing covered them. Default "fade". */
  occlusion?: Occlusion;
  /** Coordinates: longitude and latitude (RFC 7946), or metres in the scene's CRS. Default "lonlat". */
  crs?: "lonlat" | "scene";
  /** "absolute" uses given heights, in the scene's vertical CRS; "ground" drapes all features on the visible surface. Default "absolute". */
  height?: "absolute" | "ground";
  /** Returns the accessible name of a feature. Default: its property `name` or `title`, its id or its number. */
  name?: (feature: Feature) => string;
  /** false disables events of features and the keyboard list. Default true. */
  interactive?: boolean;
}

export interface FeatureEvent {
  readonly feature: Feature;
  /** CSS pixels. */
  readonly point: Vec2;
  /** World position of the surface there; null where it is not known. */
  readonly position: Vec3 | null;
}

export interface GeojsonEvents {
  /** The features are on the map. */
  ready: { features: readonly Feature[]; skipped: Skipped };
  /** All features in view are drawn, as far as the surface is known. */
  load: object;
  /** The features cannot be loaded. The map fires "error", too. */
  error: { error: Error };
  /** A feature was clicked or tapped, or Enter was pressed on its name. */
  click: FeatureEvent;
  mouseover: FeatureEvent;
  mouseout: FeatureEvent;
}

/** Shows GeoJSON on the map: points, lines and polygons, draped on the surface or at their own heights, and hidden behind buildings. */
export class GeoJSON extends MapLayer<Map3D, GeojsonEvents> {
  readonly needs = ["depth"] as const;
  readonly options: GeojsonOptions;
  readonly #data: unknown;
  readonly #renderer = new FeatureRenderer();
  #style: GeojsonOptions["style"];
  #load: AbortController | undefined;
  #placed: readonly PlacedFeature[] = [];
  #markers: { marker: Marker; dot: FeatureDot; height: number }[] = [];
  #list: FeatureList | undefined;
  #origin: Vec3 = [0, 0, 0];
  #bounds: Box3 | null = null;
  #hovered: PlacedFeature | null = null;
  #next = 0;
  #done = false;

  /** @param data GeoJSON, or its URL */
  constructor(data: object | string, options: GeojsonOptions = {}) {
    super();
    this.#data = data;
    this.options = options;
    this.#style = options.style;
    this.#renderer.occlusion = options.occlusion ?? "fade";
  }

  /** The shown features; empty before "ready". */
  get features(): readonly Feature[] {
    return this.#placed.map(({ feature }) => feature);
  }

  /** The markers that `pointToMarker` returned. */
  get markers(): readonly Marker[] {
    return this.#markers.map(({ marker }) => marker);
  }

  /** Bounding box of the features, world coordinates, for `fitBounds`; draped features span all heights of the scene. null before "ready", and without features. */
  get bounds(): Box3 | null {
    return this.#bounds;
  }

  /** Replaces the style. @throws UsageError for invalid numbers and colours */
  setStyle(style: GeojsonOptions["style"]): this {
    const styles = this.#placed.map(({ feature }) => this.#styleOf(feature, style));
    this.#style = style;
    this.#placed.forEach((placed, k) => (placed.style = styles[k] ?? placed.style));
    this.#renderer.restyle();
    this.#done = false;
    this.#draw();
    return this;
  }

  protected onAdd(map: Map3D): void {
    adoptStyles(document, STYLES);
    map.overlayPane.prepend(this.#renderer.canvas);
    map.frameEvents.on("draw", this.#draw);
    if (this.options.interactive !== false)
      map.on("preclick", this.#onClick).on("mousemove", this.#onMouseMove).on("moveend", this.#updateList).on("idle", this.#updateList);
    const load = (this.#load = new AbortController());
    this.#start(map, load.signal).catch((reason: unknown) => {
      if (load.signal.aborted) return;
      const error = reason instanceof Error ? reason : new Error(String(reason));
      this.fire("error", { error });
      map.fire("error", { error });
    });
  }

  protected onRemove(map: Map3D): void {
    this.#load?.abort();
    cancelAnimationFrame(this.#next);
    this.#clearHover();
    map.frameEvents.off("draw", this.#draw);
    map.off("preclick", this.#onClick).off("mousemove", this.#onMouseMove).off("moveend", this.#updateList).off("idle", this.#updateList);
    this.#renderer.canvas.remove();
    this.#list?.box.remove();
    for (const { marker } of this.#markers) map.discard(marker);
    this.#list = undefined;
    [this.#markers, this.#placed] = [[], []];
  }

  async #start(map: Map3D, signal: AbortSignal): Promise<void> {
    const data = typeof this.#data === "string" ? await fetchJson(this.#data, signal) : this.#data;
    const { crs = "lonlat", filter } = this.options;
    const { shapes, skipped } = readGeojson(data, crs === "lonlat");
    if (!map.visibleDepths) await new Promise<void>((ready) => map.once("ready", () => ready()));
    const { visibleDepths } = map;
    if (signal.aborted || !visibleDepths) return;
    this.#addFeatures(map, visibleDepths, filter ? shapes.filter(({ feature }) => filter(feature)) : shapes, crs);
    this.fire("ready", { features: this.features, skipped });
    map.layerContext?.requestFrame();
  }

  #addFeatures(map: Map3D, relief: VisibleDepths, shapes: readonly FeatureShape[], crs: "lonlat" | "scene"): void {
    const transform = coordinateTransform(map, relief.origin, crs);
    const { height, pointToMarker, onEachFeature, interactive, name = nameOf } = this.options;
    this.#origin = relief.origin;
    this.#placed = shapes.flatMap((shape) => placeFeature(shape, transform, height === "ground", this.#styleOf(shape.feature)) ?? []);
    this.#bounds = boundsOf(this.#placed, relief);
    if (pointToMarker) this.#placed = this.#placed.map((placed) => this.#addMarkers(map, relief, placed, pointToMarker));
    this.#renderer.set(this.#placed);
    const messages = getGeojsonMessages(map.language);
    const numbers = new Map(this.#placed.map((placed, k) => [placed, k + 1]));
    if (interactive !== false) {
      const press = (placed: PlacedFeature): void => this.#fire("click", placed, anchorOf(placed, map.visibleDepths ?? relief) ?? [0, 0]);
      this.#list = new FeatureList(
        messages.features,
        (placed) => name(placed.feature) || messages.feature(String(numbers.get(placed) ?? 0)),
        (placed) => this.#focus(placed),
        press,
      );
      map.overlayPane.append(this.#list.box);
    }
    if (onEachFeature) for (const { feature } of this.#placed) onEachFeature(feature);
  }

  /** Replaces dots of a feature with markers. */
  #addMarkers(map: Map3D, relief: VisibleDepths, placed: PlacedFeature, make: NonNullable<GeojsonOptions["pointToMarker"]>): PlacedFeature {
    const dots = placed.dots.filter((dot) => {
      const marker = make(placed.feature, worldOf(this.#origin, dot.position, relief.heights[0]));
      if (marker) this.#markers.push({ marker, dot, height: NaN });
      if (marker) map.add(marker);
      return !marker;
    });
    return { ...placed, dots };
  }

  #styleOf(feature: Feature, style = this.#style): PlacedFeature["style"] {
    const { container } = this.map ?? {};
    const accent = (container && getComputedStyle(container).getPropertyValue("--map3d-accent").trim()) || "#0e7490";
    return resolveStyle((typeof style === "function" ? style(feature) : style) ?? {}, accent);
  }

  readonly #draw = (): void => {
    const { map } = this;
    const relief = map?.visibleDepths;
    if (!relief || this.#placed.length === 0) return;
    // The results are in U and V of the next view, so they do not fit the frames of a transition.
    this.#renderer.canvas.style.visibility = map.inTransition ? "hidden" : "";
    this.#landMarkers(relief);
    const done = this.#renderer.frame(relief);
    cancelAnimationFrame(this.#next);
    if (!done) this.#next = requestAnimationFrame(this.#draw);
    else if (!this.#done) this.fire("load", {});
    this.#done = done;
  };

  /** Moves markers of points without a height to the surface as soon as it is visible. */
  #landMarkers(relief: VisibleDepths): void {
    for (const entry of this.#markers) {
      const { marker, dot } = entry;
      if (!dot.draped || !dot.updateHeight(relief) || dot.position[2] === entry.height) continue;
      entry.height = dot.position[2];
      marker.setPosition(add(this.#origin, dot.position));
    }
  }

  readonly #onClick = ({ point }: { point: Vec2 }): void => {
    const placed = this.#featureAt(point);
    if (placed) this.#fire("click", placed, point);
  };

  readonly #onMouseMove = ({ point }: { point: Vec2 }): void => {
    const placed = this.#featureAt(point);
    if (placed === this.#hovered) return;
    if (this.#hovered) this.#fire("mouseout", this.#hovered, point);
    this.#hovered = placed;
    this.map?.container.classList.toggle("map3d-over", placed !== null);
    if (placed) this.#fire("mouseover", placed, point);
  };

  readonly #updateList = (): void => {
    const relief = this.map?.visibleDepths;
    if (!relief) return;
    this.#list?.show(
      this.#placed.flatMap((placed) => {
        const at = anchorOf(placed, relief);
        return at ? [{ placed, at }] : [];
      }),
    );
  };

  #clearHover(): void {
    if (this.#hovered) this.map?.container.classList.remove("map3d-over");
    this.#hovered = null;
  }

  #focus(placed: PlacedFeature | null): void {
    this.#renderer.setFocus(placed);
    this.#draw();
  }

  #featureAt(point: Vec2): PlacedFeature | null {
    const relief = this.map?.visibleDepths;
    return relief ? hitTest(this.#placed, relief, point, this.#renderer.occlusion) : null;
  }

  #fire(type: "click" | "mouseover" | "mouseout", { feature }: PlacedFeature, point: Vec2): void {
    this.fire(type, { feature, point, position: this.map?.findSurfaceAt(point) ?? null });
  }
}

async function fetchJson(url: string, signal: AbortSignal): Promise<unknown> {
  const answer = await fetch(url, { signal }).catch((reason: unknown) => {
    throw new FetchError(`${url}: ${String(reason)}`);
  });
  if (!answer.ok) throw new FetchError(`${url}: ${String(answer.status)} ${answer.statusText}`, answer.status);
  const text = await answer.text();
  try {
    return JSON.parse(text) as unknown;
  } catch (reason) {
    throw new UsageError(`${url}: invalid JSON: ${String(reason)}`);
  }
}

function nameOf({ id, properties }: Feature): string {
  const name = [properties?.["name"], properties?.["title"], id].find(
    (value): value is string | number => (typeof value === "string" && value.trim() !== "") || typeof value === "number",
  );
  return String(name ?? "").slice(0, 120);
}

function boundsOf(placed: readonly PlacedFeature[], { origin, heights }: VisibleDepths): Box3 | null {
  const [low, high]: [number[], number[]] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  const take = (position: readonly number[], draped: boolean): void => {
    for (const z of draped ? heights : [position[2] as number]) {
      [position[0] as number, position[1] as number, z].forEach((value, k) => {
        low[k] = Math.min(low[k] as number, value);
        high[k] = Math.max(high[k] as number, value);
      });
    }
  };
  for (const { lines, dots } of placed) {
    for (const { path } of lines) for (const point of path.points) take(point, path.draped);
    for (const { position, draped } of dots) take(position, draped);
  }
  return low[0] === Infinity ? null : [add(origin, low as unknown as Vec3), add(origin, high as unknown as Vec3)];
}

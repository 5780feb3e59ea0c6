import { adoptStyles } from "../core/dom";
import { add, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { MapLayer, FetchError, UsageError, type map, type marker, type Relief } from "../map3d";
import { Drawing } from "./drawing";
import { anchorOf, hit } from "./hit";
import { FeatureList } from "./list";
import { readGeojson, type Feature, type Shape, type Skipped } from "./parse";
import { placing, worldOf } from "./place";
import { placedShape, type Occlusion, type Placed, type Spot } from "./placed";
import { filledStyle, type FeatureStyle } from "./style";
import { STYLES } from "./styles";
import { getGeojsonMessages } from "./i18n";

export interface GeojsonOptions {
  /** Of all features, or of each. */
  style?: FeatureStyle | ((feature: Feature) => FeatureStyle);
  /** What stands for a point, at its position: a marker, or null for a dot. Default dots. */
  pointToMarker?: (feature: Feature, position: Vec3) => marker | null;
  /** false: the feature is left out. */
  filter?: (feature: Feature) => boolean;
  /** Called for each feature that is shown. */
  onEachFeature?: (feature: Feature) => void;
  /** What lies behind buildings: not shown, shown pale and dashed, or shown as if nothing stood before it. Default "fade". */
  occlusion?: Occlusion;
  /** What coordinates are: longitude and latitude (RFC 7946), or metres of the scene's CRS. Default "lonlat". */
  crs?: "lonlat" | "scene";
  /** "absolute": coordinates with a height stand at it, in the scene's heights; "ground": all lie on the surface that is seen. Default "absolute". */
  height?: "absolute" | "ground";
  /** What a feature is called, for keyboards and screen readers. Default its property name or title, its id or its number. */
  name?: (feature: Feature) => string;
  /** false: no events of features, and no list of them. Default true. */
  interactive?: boolean;
}

export interface FeatureEvent {
  readonly feature: Feature;
  /** CSS pixels. */
  readonly point: Vec2;
  /** Of the surface there; null where none is known. */
  readonly position: Vec3 | null;
}

export interface GeojsonEvents {
  /** The features are on the map. */
  ready: { features: readonly Feature[]; skipped: Skipped };
  /** All that is in view is drawn, as far as the surface is known. */
  load: object;
  /** The map's "error" says so, too. */
  error: { error: Error };
  /** Clicked, tapped, or Enter pressed on its name. */
  click: FeatureEvent;
  mouseover: FeatureEvent;
  mouseout: FeatureEvent;
}

/** GeoJSON on the map: points, lines and polygons on the surface, or at heights of their own, hidden behind what stands before them. */
export class geojson extends MapLayer<map, GeojsonEvents> {
  readonly needs = ["depth"] as const;
  readonly options: GeojsonOptions;
  readonly #data: unknown;
  readonly #drawing = new Drawing();
  #style: GeojsonOptions["style"];
  #load: AbortController | undefined;
  #placed: readonly Placed[] = [];
  #markers: { marker: marker; spot: Spot; height: number }[] = [];
  #list: FeatureList | undefined;
  #origin: Vec3 = [0, 0, 0];
  #bounds: Box3 | null = null;
  #over: Placed | null = null;
  #next = 0;
  #done = false;

  /** @param data GeoJSON, or where it is to be fetched */
  constructor(data: object | string, options: GeojsonOptions = {}) {
    super();
    this.#data = data;
    this.options = options;
    this.#style = options.style;
    this.#drawing.occlusion = options.occlusion ?? "fade";
  }

  /** Features that are shown; none before "ready". */
  get features(): readonly Feature[] {
    return this.#placed.map(({ feature }) => feature);
  }

  /** What pointToMarker made. */
  get markers(): readonly marker[] {
    return this.#markers.map(({ marker }) => marker);
  }

  /** Box of the features, world coordinates, for fitBounds; those without a height lie at all heights of the scene. null before "ready", and without features. */
  get bounds(): Box3 | null {
    return this.#bounds;
  }

  /** In place of the style before. @throws UsageError for numbers and colours that are none */
  setStyle(style: GeojsonOptions["style"]): this {
    const styles = this.#placed.map(({ feature }) => this.#styleOf(feature, style));
    this.#style = style;
    this.#placed.forEach((placed, k) => (placed.style = styles[k] ?? placed.style));
    this.#drawing.restyle();
    this.#done = false;
    this.#draw();
    return this;
  }

  protected onAdd(map: map): void {
    adoptStyles(document, STYLES);
    map.overlayPane.prepend(this.#drawing.canvas);
    map.frameEvents.on("draw", this.#draw);
    if (this.options.interactive !== false) map.on("preclick", this.#clicked).on("mousemove", this.#moved).on("moveend", this.#named).on("idle", this.#named);
    const load = (this.#load = new AbortController());
    this.#begin(map, load.signal).catch((reason: unknown) => {
      if (load.signal.aborted) return;
      const error = reason instanceof Error ? reason : new Error(String(reason));
      this.fire("error", { error });
      map.fire("error", { error });
    });
  }

  protected onRemove(map: map): void {
    this.#load?.abort();
    cancelAnimationFrame(this.#next);
    this.#leave();
    map.frameEvents.off("draw", this.#draw);
    map.off("preclick", this.#clicked).off("mousemove", this.#moved).off("moveend", this.#named).off("idle", this.#named);
    this.#drawing.canvas.remove();
    this.#list?.box.remove();
    for (const { marker } of this.#markers) map.discard(marker);
    this.#list = undefined;
    [this.#markers, this.#placed] = [[], []];
  }

  async #begin(map: map, signal: AbortSignal): Promise<void> {
    const data = typeof this.#data === "string" ? await fetched(this.#data, signal) : this.#data;
    const { crs = "lonlat", filter } = this.options;
    const { shapes, skipped } = readGeojson(data, crs === "lonlat");
    if (!map.relief) await new Promise<void>((ready) => map.once("ready", () => { ready(); }));
    const { relief } = map;
    if (signal.aborted || !relief) return;
    this.#place(map, relief, filter ? shapes.filter(({ feature }) => filter(feature)) : shapes, crs);
    this.fire("ready", { features: this.features, skipped });
    map.layerContext?.requestFrame();
  }

  #place(map: map, relief: Relief, shapes: readonly Shape[], crs: "lonlat" | "scene"): void {
    const place = placing(map, relief.origin, crs);
    const { height, pointToMarker, onEachFeature, interactive, name = nameOf } = this.options;
    this.#origin = relief.origin;
    this.#placed = shapes.flatMap((shape) => placedShape(shape, place, height === "ground", this.#styleOf(shape.feature)) ?? []);
    this.#bounds = boundsOf(this.#placed, relief);
    if (pointToMarker) this.#placed = this.#placed.map((placed) => this.#marked(map, relief, placed, pointToMarker));
    this.#drawing.set(this.#placed);
    const words = getGeojsonMessages(map.language);
    const numbers = new Map(this.#placed.map((placed, k) => [placed, k + 1]));
    if (interactive !== false) {
      const press = (placed: Placed): void => { this.#fire("click", placed, anchorOf(placed, map.relief ?? relief) ?? [0, 0]); };
      this.#list = new FeatureList(words.features, (placed) => name(placed.feature) || words.feature(String(numbers.get(placed) ?? 0)), (placed) => { this.#choose(placed); }, press);
      map.overlayPane.append(this.#list.box);
    }
    if (onEachFeature) for (const { feature } of this.#placed) onEachFeature(feature);
  }

  /** The feature with markers in place of dots. */
  #marked(map: map, relief: Relief, placed: Placed, make: NonNullable<GeojsonOptions["pointToMarker"]>): Placed {
    const spots = placed.spots.filter((spot) => {
      const made = make(placed.feature, worldOf(this.#origin, spot.position, relief.heights[0]));
      if (made) this.#markers.push({ marker: made, spot, height: NaN });
      if (made) map.add(made);
      return !made;
    });
    return { ...placed, spots };
  }

  #styleOf(feature: Feature, style = this.#style): Placed["style"] {
    const { container } = this.map ?? {};
    const accent = (container && getComputedStyle(container).getPropertyValue("--map3d-accent").trim()) || "#0e7490";
    return filledStyle((typeof style === "function" ? style(feature) : style) ?? {}, accent);
  }

  readonly #draw = (): void => {
    const { map } = this;
    const relief = map?.relief;
    if (!relief || this.#placed.length === 0) return;
    // What is known lies in the plane of the view that comes.
    this.#drawing.canvas.style.visibility = map.inTransition ? "hidden" : "";
    this.#landMarkers(relief);
    const done = this.#drawing.frame(relief);
    cancelAnimationFrame(this.#next);
    if (!done) this.#next = requestAnimationFrame(this.#draw);
    else if (!this.#done) this.fire("load", {});
    this.#done = done;
  };

  /** Markers of points without a height come onto the surface as soon as it is seen. */
  #landMarkers(relief: Relief): void {
    for (const held of this.#markers) {
      const { marker, spot } = held;
      if (!spot.draped || !spot.settle(relief) || spot.position[2] === held.height) continue;
      held.height = spot.position[2];
      marker.setPosition(add(this.#origin, spot.position));
    }
  }

  readonly #clicked = ({ point }: { point: Vec2 }): void => {
    const placed = this.#hit(point);
    if (placed) this.#fire("click", placed, point);
  };

  readonly #moved = ({ point }: { point: Vec2 }): void => {
    const placed = this.#hit(point);
    if (placed === this.#over) return;
    if (this.#over) this.#fire("mouseout", this.#over, point);
    this.#over = placed;
    this.map?.container.classList.toggle("map3d-over", placed !== null);
    if (placed) this.#fire("mouseover", placed, point);
  };

  readonly #named = (): void => {
    const relief = this.map?.relief;
    if (!relief) return;
    this.#list?.show(this.#placed.flatMap((placed) => {
      const at = anchorOf(placed, relief);
      return at ? [{ placed, at }] : [];
    }));
  };

  #leave(): void {
    if (this.#over) this.map?.container.classList.remove("map3d-over");
    this.#over = null;
  }

  #choose(placed: Placed | null): void {
    this.#drawing.choose(placed);
    this.#draw();
  }

  #hit(point: Vec2): Placed | null {
    const relief = this.map?.relief;
    return relief ? hit(this.#placed, relief, point, this.#drawing.occlusion) : null;
  }

  #fire(type: "click" | "mouseover" | "mouseout", { feature }: Placed, point: Vec2): void {
    this.fire(type, { feature, point, position: this.map?.findSurfaceAt(point) ?? null });
  }
}

async function fetched(url: string, signal: AbortSignal): Promise<unknown> {
  const answer = await fetch(url, { signal }).catch((reason: unknown) => {
    throw new FetchError(`${url}: ${String(reason)}`);
  });
  if (!answer.ok) throw new FetchError(`${url}: ${String(answer.status)} ${answer.statusText}`, answer.status);
  const text = await answer.text();
  try {
    return JSON.parse(text) as unknown;
  } catch (reason) {
    throw new UsageError(`${url} is no JSON: ${String(reason)}`);
  }
}

function nameOf({ id, properties }: Feature): string {
  const name = [properties?.["name"], properties?.["title"], id].find((value): value is string | number => (typeof value === "string" && value.trim() !== "") || typeof value === "number");
  return String(name ?? "").slice(0, 120);
}

function boundsOf(placed: readonly Placed[], { origin, heights }: Relief): Box3 | null {
  const [low, high]: [number[], number[]] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  const take = (position: readonly number[], draped: boolean): void => {
    for (const z of draped ? heights : [position[2] as number]) {
      [position[0] as number, position[1] as number, z].forEach((value, k) => {
        low[k] = Math.min(low[k] as number, value);
        high[k] = Math.max(high[k] as number, value);
      });
    }
  };
  for (const { lines, spots } of placed) {
    for (const { path } of lines) for (const point of path.points) take(point, path.draped);
    for (const { position, draped } of spots) take(position, draped);
  }
  return low[0] === Infinity ? null : [add(origin, low as unknown as Vec3), add(origin, high as unknown as Vec3)];
}

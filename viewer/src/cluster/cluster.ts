import { adoptStyles, element } from "../core/dom";
import { selectTranslation } from "../core/i18n";
import { sub, type Vec2, type Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import { MapLayer, Marker, UsageError, type Map3D, type VisibleDepths } from "../map3d";
import { groupPoints, spiderOffsets, type MarkerGroup } from "./groups";
import { STYLES } from "./styles";

export interface ClusterOptions {
  /** Cluster radius in CSS pixels. Default 56. */
  radius_px?: number;
  /** Any CSS colour. Default: the map's accent colour. */
  color?: string;
  /** Returns the accessible name of a cluster. Default: the number of its markers. */
  label?: (markers: readonly Marker[]) => string;
}

export interface ClusterEvents {
  /** A cluster was clicked. */
  click: { markers: readonly Marker[]; position: Vec3 };
  /** The markers of a cluster were spread, because no zoom level separates them. */
  spread: { markers: readonly Marker[] };
  /** Spread markers were joined again. */
  join: object;
}

const MESSAGES = {
  en: (count: string) => `${count} markers`,
  de: (count: string) => `${count} Markierungen`,
  fr: (count: string) => `${count} repères`,
};
/** Clusters this far outside the screen are kept, CSS pixels. */
const MARGIN_PX = 60;
/** Distance between spread markers, CSS pixels. */
const SPREAD_PX = 48;
const SVG = "http://www.w3.org/2000/svg";

interface VisibleItem {
  readonly item: Marker;
  readonly group: MarkerGroup;
}

/**
 * Combines markers that are close together on the screen. A click zooms to where they separate, or spreads them if no zoom level separates them.
 * Clusters are computed per integer zoom level, so that they stay stable while the map moves. Only clusters in view have page elements.
 */
export class Cluster extends MapLayer<Map3D, ClusterEvents> {
  readonly options: Required<Omit<ClusterOptions, "color" | "label">> & Pick<ClusterOptions, "color" | "label">;
  #markers: readonly Marker[];
  #groups = new Map<number, MarkerGroup[]>();
  #uv = new Float64Array();
  #view = "";
  /** Items on the map, by seed and level. */
  #shown = new Map<string, VisibleItem>();
  #spread:
    | {
        readonly key: string;
        readonly markers: readonly Marker[];
        readonly shifts: readonly Vec2[];
        readonly legs: SVGSVGElement;
        readonly zoom: number;
      }
    | undefined;

  /** @param markers the cluster adds them to the map; do not add them yourself */
  constructor(markers: readonly Marker[] = [], options: ClusterOptions = {}) {
    super();
    this.options = { radius_px: 56, ...options };
    if (!(this.options.radius_px > 0)) throw new UsageError(`radius_px must be greater than 0, got ${String(this.options.radius_px)}`);
    this.#markers = checkMarkers(markers);
  }

  /** All markers, in the given order. */
  get markers(): readonly Marker[] {
    return this.#markers;
  }

  /** Replaces all markers. Call it after markers have moved, too. */
  setMarkers(markers: readonly Marker[]): this {
    const checked = checkMarkers(markers);
    this.#clear();
    this.#markers = checked;
    this.#view = "";
    this.map?.layerContext?.requestFrame();
    return this;
  }

  protected onAdd(map: Map3D): void {
    adoptStyles(document, STYLES);
    map.frameEvents.on("draw", this.#update);
    map.on("preclick", this.#join);
    map.container.addEventListener("keydown", this.#onKeyDown);
    this.#update();
  }

  protected onRemove(map: Map3D): void {
    this.#clear();
    map.frameEvents.off("draw", this.#update);
    map.off("preclick", this.#join);
    map.container.removeEventListener("keydown", this.#onKeyDown);
  }

  readonly #update = (): void => {
    const [map, relief] = [this.map, this.map?.visibleDepths];
    if (!map || !relief) return;
    this.#updateView(relief);
    if (this.#spread && Math.abs(map.zoom - this.#spread.zoom) > 1e-6) this.#join();
    const level = Math.floor(map.zoom + 1e-6);
    const inView = new Map<string, MarkerGroup>();
    const px_m = metresAt(relief, map.zoom);
    const { camera } = relief;
    const [w, h] = [(camera.width / 2 + MARGIN_PX) * px_m, (camera.height / 2 + MARGIN_PX) * px_m];
    for (const group of this.#groupsAt(relief, level))
      if (Math.abs(group.u - camera.u) <= w && Math.abs(group.v - camera.v) <= h)
        inView.set(`${String(group.members[0])} ${group.members.length > 1 ? String(level) : ""}`, group);
    for (const [key, { item }] of [...this.#shown]) {
      if (inView.has(key)) continue;
      map.discard(item);
      this.#shown.delete(key);
    }
    for (const [key, group] of inView) if (!this.#shown.has(key)) this.#show(map, key, group);
    this.#drawLegs();
  };

  /** Recomputes the positions of the markers in U and V when the view changes. */
  #updateView({ camera, origin }: VisibleDepths): void {
    const view = [camera.frame.id, ...origin].join(" ");
    if (view === this.#view) return;
    this.#clear();
    this.#view = view;
    this.#groups.clear();
    this.#uv = new Float64Array(2 * this.#markers.length);
    this.#markers.forEach((one, k) => this.#uv.set(uvdFromLocal(camera.frame.axes, sub(positionOf(one), origin)).slice(0, 2), 2 * k));
  }

  #groupsAt(relief: VisibleDepths, level: number): MarkerGroup[] {
    const groups = this.#groups.get(level) ?? groupPoints(this.#uv, this.options.radius_px * metresAt(relief, level));
    this.#groups.set(level, groups);
    return groups;
  }

  #show(map: Map3D, key: string, group: MarkerGroup): void {
    const markers = this.#markersOf(group);
    const [first] = markers;
    if (!first) return;
    const item = markers.length === 1 ? first : this.#clusterMarker(map, key, group, markers);
    this.#shown.set(key, { item, group });
    map.add(item);
  }

  #markersOf({ members }: MarkerGroup): Marker[] {
    return members.flatMap((member) => this.#markers[member] ?? []);
  }

  #clusterMarker(map: Map3D, key: string, group: MarkerGroup, markers: readonly Marker[]): Marker {
    const { label, color } = this.options;
    const count = markers.length.toLocaleString(map.language);
    const position = [0, 1, 2].map(
      (k) => markers.reduce((sum, one) => sum + (positionOf(one)[k] as number), 0) / markers.length,
    ) as unknown as Vec3;
    const item = new Marker(label?.(markers) ?? selectTranslation(MESSAGES, map.language)(count), position, {
      showLabel: false,
      icon: element("span", "map3d-cluster", {}, count),
      ...(color !== undefined && { color }),
    });
    return item.on("click", () => {
      item.select(false);
      this.fire("click", { markers, position });
      this.#expand(map, key, group, position);
    });
  }

  /** Zooms to the first level that separates the group, or spreads it. */
  #expand(map: Map3D, key: string, group: MarkerGroup, position: Vec3): void {
    const relief = map.visibleDepths;
    if (!relief) return;
    const [, greatest] = map.zoomLimits;
    const uv = new Float64Array(group.members.flatMap((member) => [...this.#uv.subarray(2 * member, 2 * member + 2)]));
    for (let level = Math.floor(map.zoom + 1e-6) + 1; level <= greatest; level++) {
      if (groupPoints(uv, this.options.radius_px * metresAt(relief, level)).length > 1) return void map.flyTo(position, level);
    }
    const wasSpread = this.#spread?.key === key;
    this.#join();
    if (!wasSpread) this.#spreadOut(map, key, this.#markersOf(group), map.project(position) ?? [0, 0]);
  }

  /** Spreads markers around a point of the screen. */
  #spreadOut(map: Map3D, key: string, markers: readonly Marker[], [x, y]: Vec2): void {
    const legs = document.createElementNS(SVG, "svg");
    legs.setAttribute("class", "map3d-legs");
    legs.setAttribute("aria-hidden", "true");
    legs.append(...markers.map(() => document.createElementNS(SVG, "line")));
    map.overlayPane.prepend(legs);
    const offsets = spiderOffsets(markers.length, SPREAD_PX);
    const shifts = markers.map((one, k): Vec2 => {
      const [[dx, dy], at] = [offsets[k] ?? [0, 0], map.project(positionOf(one)) ?? [x, y]];
      return [x + dx - at[0], y + dy - at[1]];
    });
    this.#spread = { key, markers, shifts, legs, zoom: map.zoom };
    markers.forEach((one, k) => map.add(one.setOffset(shifts[k] ?? [0, 0])));
    this.#drawLegs();
    this.fire("spread", { markers });
  }

  #drawLegs(): void {
    if (!this.#spread || !this.map) return;
    const { markers, shifts, legs } = this.#spread;
    markers.forEach((one, k) => {
      const [at, [dx, dy]] = [this.map?.project(positionOf(one)) ?? [0, 0], shifts[k] ?? [0, 0]];
      Object.entries({ x1: at[0], y1: at[1], x2: at[0] + dx, y2: at[1] + dy }).forEach(([name, value]) =>
        legs.children[k]?.setAttribute(name, value.toFixed(1)),
      );
    });
  }

  readonly #join = (): void => {
    const spread = this.#spread;
    if (!spread) return;
    this.#spread = undefined;
    spread.legs.remove();
    for (const one of spread.markers) this.map?.discard(one.setOffset([0, 0]));
    this.fire("join", {});
  };

  readonly #onKeyDown = ({ key }: KeyboardEvent): void => {
    if (key === "Escape") this.#join();
  };

  #clear(): void {
    this.#join();
    for (const { item } of this.#shown.values()) this.map?.discard(item);
    this.#shown.clear();
  }
}

/** @throws UsageError for a marker whose position is not known yet */
function positionOf({ label, position }: Marker): Vec3 {
  if (!position)
    throw new UsageError(`the position of the marker "${label}" is not known: give [x, y, z], or those that map.findPosition finds`);
  return position;
}

function checkMarkers(markers: readonly Marker[]): readonly Marker[] {
  markers.forEach(positionOf);
  return [...markers];
}

/** Metres per CSS pixel at a zoom level. */
const metresAt = ({ pixel_m, level }: VisibleDepths, zoom: number): number => pixel_m * 2 ** (level - zoom);

import { adoptStyles, element } from "../core/dom";
import { selectTranslation } from "../core/i18n";
import { sub, type Vec2, type Vec3 } from "../core/vec";
import { uvdFromLocal } from "../geo/axes";
import { MapLayer, marker, UsageError, type map, type Relief } from "../map3d";
import { groupsOf, spread, type Group } from "./groups";
import { STYLES } from "./styles";

export interface ClusterOptions {
  /** Markers that lie within so many CSS pixels of another join it. Default 56. */
  radius_px?: number;
  /** Any CSS colour; default the map's accent. */
  color?: string;
  /** What a cluster is called; read aloud. Default says how many there are. */
  label?: (markers: readonly marker[]) => string;
}

export interface ClusterEvents {
  /** A cluster was clicked. */
  click: { markers: readonly marker[]; position: Vec3 };
  /** Markers of one place were spread, or joined again. */
  spread: { markers: readonly marker[] };
  join: object;
}

const WORDS = {
  en: (count: string) => `${count} places here`,
  de: (count: string) => `${count} Orte hier`,
  fr: (count: string) => `${count} lieux ici`,
};
/** Around the screen, CSS pixels. */
const MARGIN_PX = 60;
/** Between markers that are spread. */
const APART_PX = 48;
const SVG = "http://www.w3.org/2000/svg";

interface Shown {
  readonly item: marker;
  readonly group: Group;
}

/**
 * Markers that lie close together on the screen join into one with their number; a click on it comes nearer, or, where that does not part them, spreads them. Groups are those of a
 * whole zoom level, so that they stay while the picture moves; only what is in view has elements in the page.
 */
export class cluster extends MapLayer<map, ClusterEvents> {
  readonly options: Required<Omit<ClusterOptions, "color" | "label">> & Pick<ClusterOptions, "color" | "label">;
  #markers: readonly marker[];
  #groups = new Map<number, Group[]>();
  #uv = new Float64Array();
  #view = "";
  /** By what they show: the first member and the level. */
  #shown = new Map<string, Shown>();
  #spread: { readonly key: string; readonly markers: readonly marker[]; readonly shifts: readonly Vec2[]; readonly legs: SVGSVGElement; readonly zoom: number } | undefined;

  /** @param markers they are added to maps by the cluster, not by the page */
  constructor(markers: readonly marker[] = [], options: ClusterOptions = {}) {
    super();
    this.options = { radius_px: 56, ...options };
    if (!(this.options.radius_px > 0)) throw new UsageError(`radius_px is a number above 0, got ${String(this.options.radius_px)}`);
    this.#markers = [...markers];
  }

  /** All markers, in the order in which they were given. */
  get markers(): readonly marker[] {
    return this.#markers;
  }

  /** In place of those before; also when some have moved. */
  setMarkers(markers: readonly marker[]): this {
    this.#clear();
    this.#markers = [...markers];
    this.#view = "";
    this.map?.layerContext?.requestFrame();
    return this;
  }

  protected onAdd(map: map): void {
    adoptStyles(document, STYLES);
    map.frameEvents.on("draw", this.#place);
    map.on("preclick", this.#join);
    map.container.addEventListener("keydown", this.#pressed);
    this.#place();
  }

  protected onRemove(map: map): void {
    this.#clear();
    map.frameEvents.off("draw", this.#place);
    map.off("preclick", this.#join);
    map.container.removeEventListener("keydown", this.#pressed);
  }

  readonly #place = (): void => {
    const [map, relief] = [this.map, this.map?.relief];
    if (!map || !relief) return;
    this.#turn(relief);
    if (this.#spread && Math.abs(map.zoom - this.#spread.zoom) > 1e-6) this.#join();
    const level = Math.floor(map.zoom + 1e-6);
    const wanted = new Map<string, Group>();
    const far = metresAt(relief, map.zoom);
    const { camera } = relief;
    const [w, h] = [(camera.width / 2 + MARGIN_PX) * far, (camera.height / 2 + MARGIN_PX) * far];
    for (const group of this.#groupsAt(relief, level)) if (Math.abs(group.u - camera.u) <= w && Math.abs(group.v - camera.v) <= h) wanted.set(`${String(group.members[0])} ${group.members.length > 1 ? String(level) : ""}`, group);
    for (const [key, { item }] of [...this.#shown]) {
      if (wanted.has(key)) continue;
      map.discard(item);
      this.#shown.delete(key);
    }
    for (const [key, group] of wanted) if (!this.#shown.has(key)) this.#show(map, key, group);
    this.#drawLegs();
  };

  /** Another view of the rendering: places lie elsewhere. */
  #turn({ camera, origin }: Relief): void {
    const view = [camera.frame.id, ...origin].join(" ");
    if (view === this.#view) return;
    this.#clear();
    this.#view = view;
    this.#groups.clear();
    this.#uv = new Float64Array(2 * this.#markers.length);
    this.#markers.forEach(({ position }, k) => { this.#uv.set(uvdFromLocal(camera.frame.axes, sub(position, origin)).slice(0, 2), 2 * k); });
  }

  #groupsAt(relief: Relief, level: number): Group[] {
    const groups = this.#groups.get(level) ?? groupsOf(this.#uv, this.options.radius_px * metresAt(relief, level));
    this.#groups.set(level, groups);
    return groups;
  }

  #show(map: map, key: string, group: Group): void {
    const markers = this.#of(group);
    const [first] = markers;
    if (!first) return;
    const item = markers.length === 1 ? first : this.#joined(map, key, group, markers);
    this.#shown.set(key, { item, group });
    map.add(item);
  }

  #of({ members }: Group): marker[] {
    return members.flatMap((member) => this.#markers[member] ?? []);
  }

  #joined(map: map, key: string, group: Group, markers: readonly marker[]): marker {
    const { label, color } = this.options;
    const count = markers.length.toLocaleString(map.language);
    const position = [0, 1, 2].map((k) => markers.reduce((sum, one) => sum + (one.position[k] as number), 0) / markers.length) as unknown as Vec3;
    const item = new marker(label?.(markers) ?? selectTranslation(WORDS, map.language)(count), position, { showLabel: false, icon: element("span", "map3d-cluster", {}, count), ...(color !== undefined && { color }) });
    return item.on("click", () => {
      item.select(false);
      this.fire("click", { markers, position });
      this.#open(map, key, group, position);
    });
  }

  /** Comes as near as parts the group; spreads it where nothing does. */
  #open(map: map, key: string, group: Group, position: Vec3): void {
    const relief = map.relief;
    if (!relief) return;
    const [, greatest] = map.zoomLimits;
    const own = new Float64Array(group.members.flatMap((member) => [...this.#uv.subarray(2 * member, 2 * member + 2)]));
    for (let level = Math.floor(map.zoom + 1e-6) + 1; level <= greatest; level++) {
      if (groupsOf(own, this.options.radius_px * metresAt(relief, level)).length > 1) return void map.flyTo(position, level);
    }
    const open = this.#spread?.key === key;
    this.#join();
    if (!open) this.#spreadOut(map, key, this.#of(group), map.project(position) ?? [0, 0]);
  }

  /** Around a place of the screen. */
  #spreadOut(map: map, key: string, markers: readonly marker[], [x, y]: Vec2): void {
    const legs = document.createElementNS(SVG, "svg");
    legs.setAttribute("class", "map3d-legs");
    legs.setAttribute("aria-hidden", "true");
    legs.append(...markers.map(() => document.createElementNS(SVG, "line")));
    map.overlayPane.prepend(legs);
    const places = spread(markers.length, APART_PX);
    const shifts = markers.map(({ position }, k): Vec2 => {
      const [[dx, dy], at] = [places[k] ?? [0, 0], map.project(position) ?? [x, y]];
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
    markers.forEach(({ position }, k) => {
      const [at, [dx, dy]] = [this.map?.project(position) ?? [0, 0], shifts[k] ?? [0, 0]];
      Object.entries({ x1: at[0], y1: at[1], x2: at[0] + dx, y2: at[1] + dy }).forEach(([name, value]) => legs.children[k]?.setAttribute(name, value.toFixed(1)));
    });
  }

  readonly #join = (): void => {
    const open = this.#spread;
    if (!open) return;
    this.#spread = undefined;
    open.legs.remove();
    for (const one of open.markers) this.map?.discard(one.setOffset([0, 0]));
    this.fire("join", {});
  };

  readonly #pressed = ({ key }: KeyboardEvent): void => {
    if (key === "Escape") this.#join();
  };

  #clear(): void {
    this.#join();
    for (const { item } of this.#shown.values()) this.map?.discard(item);
    this.#shown.clear();
  }
}

/** Metres a CSS pixel at a zoom. */
const metresAt = ({ pixel_m, level }: Relief, zoom: number): number => pixel_m * 2 ** (level - zoom);

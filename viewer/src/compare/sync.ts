import { adoptStyles, element } from "../core/dom";
import { Evented, UsageError, type Map3D, type Vec3 } from "../map3d";
import { describeDirection } from "./i18n";
import { STYLES } from "./styles";

/** Options of `sync`. */
export interface SyncOptions {
  /** For each map, how far its direction is turned from that of the first one, degrees counter-clockwise; the nearest direction of its rendering is shown. Default: 0 for all. */
  turns_deg?: readonly number[];
  /** Write on each map where it looks, such as "Facing north". Default false. */
  captions?: boolean;
}

/** Events of `sync`. */
export interface SyncEvents {
  /** Another map leads. */
  lead: { map: Map3D };
}

/** Heights that differ by less are the same. */
const SAME_M = 0.01;
const TOUCHES = ["pointerdown", "wheel", "keydown"] as const;

/** Moves several maps together: the same place at the centre and the same zoom, in directions of their own. The map that the user touched last leads. */
export class Sync extends Evented<SyncEvents> {
  readonly #maps: readonly Map3D[];
  readonly #turns: readonly number[];
  readonly #abort = new AbortController();
  readonly #captions = new Map<Map3D, HTMLElement>();
  #leader: Map3D;
  /** Height of the surface at the centre, world; null until it is known. */
  #height: number | null = null;

  /** @throws UsageError for fewer than two maps, the same map twice, or turns that are not one number per map */
  constructor(maps: readonly Map3D[], { turns_deg = maps.map(() => 0), captions = false }: SyncOptions = {}) {
    super();
    const [first] = maps;
    if (!first || maps.length < 2 || new Set(maps).size < maps.length)
      throw new UsageError(`sync needs at least two different maps, got ${String(maps.length)}`);
    if (turns_deg.length !== maps.length || !turns_deg.every(Number.isFinite))
      throw new UsageError(`sync: turns_deg must be a number of degrees for each of the ${String(maps.length)} maps`);
    [this.#maps, this.#turns, this.#leader] = [[...maps], turns_deg, first];
    if (captions) adoptStyles(document, STYLES);
    for (const each of maps) {
      if (captions) this.#captions.set(each, each.overlayPane.appendChild(element("div", "map3d-facing")));
      this.#listen(each);
    }
  }

  protected override get eventTypes(): readonly (keyof SyncEvents)[] {
    return ["lead"];
  }

  /** The map that the others follow. */
  get leader(): Map3D {
    return this.#leader;
  }

  /** Makes another map the one that the others follow, for example before a script moves it. @throws UsageError for a map that is not among them */
  lead(map: Map3D): this {
    if (!this.#maps.includes(map)) throw new UsageError("sync: this map is not among those that move together");
    if (map === this.#leader) return this;
    this.#leader = map;
    this.#height = null;
    return this.fire("lead", { map });
  }

  /** Ends the connection; the maps stay where they are. */
  remove(): this {
    this.#abort.abort();
    for (const each of this.#maps)
      each
        .off("move", this.#follow)
        .off("idle", this.#settle)
        .off("directionchange", this.#follow)
        .off("ready", this.#follow)
        .off("directionchange", this.#describe)
        .off("ready", this.#describe);
    for (const caption of this.#captions.values()) caption.remove();
    return this;
  }

  #listen(map: Map3D): void {
    const { signal } = this.#abort;
    for (const type of TOUCHES) map.container.addEventListener(type, () => this.lead(map), { capture: true, passive: true, signal });
    map.on("move", this.#follow).on("directionchange", this.#follow).on("ready", this.#follow).on("idle", this.#settle);
    map
      .on("directionchange", this.#describe)
      .on("ready", this.#describe)
      .on("remove", () => this.remove());
    if (map.getViewState()) this.#describe({ target: map });
    this.#follow({ target: map });
  }

  readonly #describe = ({ target }: { target: unknown }): void => {
    const shown = target as Map3D;
    const caption = this.#captions.get(shown);
    if (caption) caption.textContent = describeDirection(shown.lookAt_deg, shown.language);
  };

  /** At rest, reads the height of the surface at the centre, so that hills and roofs have the same place at all centres. */
  readonly #settle = ({ target }: { target: unknown }): void => {
    const leader = this.#leader;
    if (target !== leader || this.#abort.signal.aborted) return;
    const { clientWidth, clientHeight } = leader.container;
    void leader.pick([clientWidth / 2, clientHeight / 2]).then(({ position }) => {
      if (!position || leader !== this.#leader || this.#abort.signal.aborted || Math.abs(position[2] - (this.#height ?? Infinity)) < SAME_M)
        return;
      this.#height = position[2];
      this.#follow({ target });
    });
  };

  readonly #follow = ({ target }: { target: unknown }): void => {
    const leader = this.#leader;
    const [center, first] = [this.#findCenter(), this.#turns[this.#maps.indexOf(leader)] ?? 0];
    if (!center) return;
    this.#maps.forEach((each, k) => {
      if (each === leader || (target !== leader && target !== each) || !each.getViewState()) return;
      const direction = findDirection(each, leader, (this.#turns[k] ?? 0) - first);
      if (direction !== null && direction !== each.direction) each.setDirection(direction, center);
      if (target === leader) each.setView(center, leader.zoom);
    });
  };

  /** Returns the world position at the leader's centre, at the height of the surface if it is known. */
  #findCenter(): Vec3 | null {
    const { clientWidth, clientHeight } = this.#leader.container;
    const [view, ground] = [this.#leader.getViewState(), this.#leader.unproject([clientWidth / 2, clientHeight / 2])];
    if (!view || !ground) return null;
    const [x, y, z] = view.camera.frame.axes.forward;
    const along = this.#height === null ? 0 : (this.#height - ground[2]) / z;
    return [ground[0] + along * x, ground[1] + along * y, ground[2] + along * z];
  }
}

/** Finds the direction of a map that is nearest to the leader's, turned, at the nearest pitch; null if it has none. */
function findDirection(each: Map3D, leader: Map3D, turn_deg: number): string | null {
  const from = leader.directions.find(({ id }) => id === leader.direction);
  if (!from) return null;
  const apart = (deg: number): number => Math.abs(((((deg - from.lookAt_deg - turn_deg) % 360) + 540) % 360) - 180);
  const [nearest] = [...each.directions].sort(
    (a, b) => Math.abs(a.pitch_deg - from.pitch_deg) - Math.abs(b.pitch_deg - from.pitch_deg) || apart(a.lookAt_deg) - apart(b.lookAt_deg),
  );
  return nearest?.id ?? null;
}

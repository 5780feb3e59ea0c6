import type { Map3D, Vec3 } from "./map3d.module.js";

/** The state that the page's URL fragment holds. */
export interface PermalinkState {
  readonly direction?: string;
  readonly center?: Vec3;
  readonly zoom?: number;
  /** Time of the light. */
  readonly time?: Date;
  /** Id of the selected object. */
  readonly id?: number;
  /** Index of the shown epoch; absent for the first. */
  readonly epoch?: number;
  /** Attribute that objects are coloured by. */
  readonly by?: string;
}

/** The fragment has decimetres, which can be a few pixels. */
const TOLERANCE_PX = 2;
/** Browsers limit how often the URL may change. */
const THROTTLE_MS = 400;

/** Parses `#<view>/<x>/<y>/<z>/<zoom>`, followed by any of `/t=<UTC time>`, `/epoch=<index>`, `/id=<object>` and `/by=<attribute>`. Ignores anything else. */
export function readPermalink(hash: string): PermalinkState {
  const [direction, x, y, z, zoom, ...more] = decoded(hash.replace(/^#/, "")).split("/");
  const numbers = [x, y, z, zoom].map(Number);
  if (!direction || !x || !y || !z || !zoom || !numbers.every(Number.isFinite)) return {};
  const value = (name: string): string | undefined => more.find((part) => part.startsWith(`${name}=`))?.slice(name.length + 1);
  const [time, epoch, id, by] = [
    new Date(value("t") ?? ""),
    Number(value("epoch") ?? ""),
    Number(value("id") ?? ""),
    decoded(value("by") ?? ""),
  ];
  return {
    direction,
    center: numbers.slice(0, 3) as unknown as Vec3,
    zoom: numbers[3] as number,
    ...(!Number.isNaN(time.getTime()) && { time }),
    ...(Number.isInteger(epoch) && epoch > 0 && { epoch }),
    ...(Number.isInteger(id) && id > 0 && { id }),
    ...(by !== "" && { by }),
  };
}

/** Keeps the view, the time, the selected object, the epoch and the colouring attribute in the page's URL. */
export class Permalink {
  /** Id of the selected object; 0 for none. */
  id = 0;
  /** Index of the shown epoch. */
  epoch = 0;
  /** Attribute that objects are coloured by; "" for none. */
  by = "";
  readonly #view: Map3D;
  #timer = 0;
  #paused = false;

  constructor(view: Map3D) {
    this.#view = view;
    view.on("moveend", () => this.write());
    view.on("directionchange", () => this.write());
    view.on("lightchange", () => {
      clearTimeout(this.#timer);
      this.#timer = window.setTimeout(() => this.write(), THROTTLE_MS);
    });
  }

  /** Writes the state to the URL. @param push adds a history entry */
  write(push = false): void {
    const hash = this.#paused ? null : this.#hash();
    if (hash === null || hash === location.hash) return;
    if (push) history.pushState(null, "", hash);
    else history.replaceState(null, "", hash);
  }

  /** Runs an action without writing, such as applying the URL step by step. */
  paused(action: () => void): void {
    this.#paused = true;
    action();
    this.#paused = false;
  }

  #hash(): string | null {
    const view = this.#view;
    const { time } = view;
    const center = writtenCenter(view) ?? view.center;
    if (!center) return null;
    const parts = [view.direction, ...center.map((part) => part.toFixed(1)), view.zoom.toFixed(2)];
    if (time) parts.push(`t=${time.toISOString().slice(0, 16)}Z`);
    if (this.epoch > 0) parts.push(`epoch=${String(this.epoch)}`);
    if (this.id > 0) parts.push(`id=${String(this.id)}`);
    // Encoded twice: a name may contain a slash, and the whole fragment is decoded before it is split.
    if (this.by !== "") parts.push(`by=${encodeURIComponent(encodeURIComponent(this.by))}`);
    return `#${parts.join("/")}`;
  }
}

/** The centre in the URL, as long as it is still at the centre of the screen: new tiles change the height of the surface there, which must not rewrite the URL. */
function writtenCenter(view: Map3D): Vec3 | null {
  const { direction, center, zoom } = readPermalink(location.hash);
  const at = direction === view.direction && center && Math.abs((zoom ?? NaN) - view.zoom) < 0.01 ? view.project(center) : null;
  const { clientWidth, clientHeight } = view.container;
  return center && at && Math.hypot(at[0] - clientWidth / 2, at[1] - clientHeight / 2) < TOLERANCE_PX ? center : null;
}

function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return "";
  }
}

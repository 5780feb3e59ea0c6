import type { map, Vec3 } from "./map3d.mjs";

/** What a page's address says of what is seen. */
export interface Place {
  readonly direction?: string;
  readonly center?: Vec3;
  readonly zoom?: number;
  /** Of the light. */
  readonly time?: Date;
  /** Of the chosen object. */
  readonly id?: number;
  /** Number of the epoch that is shown; the first is left out. */
  readonly epoch?: number;
  /** Attribute that colours the objects. */
  readonly by?: string;
}

/** An address has decimetres, which are up to some pixels. */
const SAME_PX = 2;

/** `#<direction>/<x>/<y>/<z>/<zoom>`, then `/t=<UTC time>`, `/epoch=<number>`, `/id=<object>` and `/by=<attribute>` if they are set. Anything else is ignored. */
export function readPlace(hash: string): Place {
  const [direction, x, y, z, zoom, ...more] = decoded(hash.replace(/^#/, "")).split("/");
  const numbers = [x, y, z, zoom].map(Number);
  if (!direction || !x || !y || !z || !zoom || !numbers.every(Number.isFinite)) return {};
  const value = (name: string): string | undefined => more.find((part) => part.startsWith(`${name}=`))?.slice(name.length + 1);
  const [time, epoch, id, by] = [new Date(value("t") ?? ""), Number(value("epoch") ?? ""), Number(value("id") ?? ""), decoded(value("by") ?? "")];
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

/** Puts what is seen into the address; `step`: as a step that the back button takes back. */
export function writePlace(view: map, { id, by, epoch }: { readonly id: number; readonly by: string; readonly epoch: number }, step = false): void {
  const { time } = view;
  const center = saidCenter(view) ?? view.center;
  if (!center) return;
  const parts = [view.direction, ...center.map((part) => part.toFixed(1)), view.zoom.toFixed(2)];
  if (time) parts.push(`t=${time.toISOString().slice(0, 16)}Z`);
  if (epoch > 0) parts.push(`epoch=${String(epoch)}`);
  if (id > 0) parts.push(`id=${String(id)}`);
  // Twice, since a name may have a slash and the whole is decoded before it is taken apart.
  if (by !== "") parts.push(`by=${encodeURIComponent(encodeURIComponent(by))}`);
  const hash = `#${parts.join("/")}`;
  if (hash === location.hash) return;
  if (step) history.pushState(null, "", hash);
  else history.replaceState(null, "", hash);
}

/** The address's own centre, as long as it is in the middle: which point of a ray that is is known better as tiles come, and need not be said anew. */
function saidCenter(view: map): Vec3 | null {
  const { direction, center, zoom } = readPlace(location.hash);
  const at = direction === view.direction && center && Math.abs((zoom ?? NaN) - view.zoom) < 0.01 ? view.project(center) : null;
  const { clientWidth, clientHeight } = view.container;
  return center && at && Math.hypot(at[0] - clientWidth / 2, at[1] - clientHeight / 2) < SAME_PX ? center : null;
}

function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return "";
  }
}

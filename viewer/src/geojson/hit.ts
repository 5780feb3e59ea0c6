import type { Vec2 } from "../core/vec";
import type { Relief } from "../map3d";
import { viewOf } from "./drawing";
import type { Line, Occlusion, Placed } from "./placed";

/** A hand is not exact: CSS pixels around lines and dots. */
const AROUND_PX = 6;

/** The feature that is drawn topmost under CSS pixels: dots before lines before what is filled. */
export function hit(placed: readonly Placed[], relief: Relief, [x, y]: Vec2, occlusion: Occlusion): Placed | null {
  const [low, high] = viewOf(relief);
  const px = (high[0] - low[0]) / relief.camera.width;
  const at: Vec2 = [low[0] + x * px, high[1] - y * px];
  const last = (test: (one: Placed) => boolean): Placed | undefined => placed.findLast(test);
  const onSpot = ({ spots, style }: Placed): boolean =>
    spots.some((spot) => spot.at && !(spot.hidden && occlusion === "hide") && Math.hypot(spot.at[0] - at[0], spot.at[1] - at[1]) <= (style.radius + AROUND_PX) * px);
  const onLine = ({ lines, style }: Placed): boolean => style.width > 0 && lines.some((line) => near(line, at, (style.width / 2 + AROUND_PX) * px, occlusion));
  const inside = ({ polygons, style }: Placed): boolean => style.fill !== null && polygons.some((polygon) => polygon.has(relief, at, occlusion));
  return last(onSpot) ?? last(onLine) ?? last(inside) ?? null;
}

function near({ runs, reach }: Line, [u, v]: Vec2, far: number, occlusion: Occlusion): boolean {
  if (!reach || u < reach[0][0] - far || v < reach[0][1] - far || u > reach[1][0] + far || v > reach[1][1] + far) return false;
  return runs.some(({ uv, hidden }) => {
    if (hidden && occlusion === "hide") return false;
    for (let k = 2; k < uv.length; k += 2) if (apart(u, v, uv[k - 2] as number, uv[k - 1] as number, uv[k] as number, uv[k + 1] as number) <= far) return true;
    return false;
  });
}

/** Of a point from a segment. */
function apart(u: number, v: number, u0: number, v0: number, u1: number, v1: number): number {
  const [du, dv] = [u1 - u0, v1 - v0];
  const t = Math.min(Math.max(((u - u0) * du + (v - v0) * dv) / (du * du + dv * dv || 1), 0), 1);
  return Math.hypot(u0 + t * du - u, v0 + t * dv - v);
}

/** Where on the screen (CSS pixels) a feature can be named: at a dot, or in the middle of what is seen of its lines. null: it is not in view. */
export function anchorOf({ spots, lines }: Placed, relief: Relief): Vec2 | null {
  const [low, high] = viewOf(relief);
  const px = (high[0] - low[0]) / relief.camera.width;
  const found: Vec2[] = [];
  const keep = (u: number, v: number): void => { if (u >= low[0] && v >= low[1] && u <= high[0] && v <= high[1]) found.push([(u - low[0]) / px, (high[1] - v) / px]); };
  for (const { at, hidden } of spots) if (at && !hidden) keep(at[0], at[1]);
  for (const { reach, runs } of lines) {
    if (found.length > 0 || !reach) break;
    for (const { uv, hidden } of runs) for (let k = 0; k < uv.length && !hidden; k += 2) keep(uv[k] as number, uv[k + 1] as number);
  }
  return found[Math.floor(found.length / 2)] ?? null;
}

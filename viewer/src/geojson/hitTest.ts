import type { Vec2 } from "../core/vec";
import type { VisibleDepths } from "../map3d";
import { screenRect } from "./featureRenderer";
import type { FeatureLine, Occlusion, PlacedFeature } from "./placedFeature";

/** Hit tolerance around lines and dots, CSS pixels. */
const TOLERANCE_PX = 6;

/** Returns the topmost feature at a point of the screen (CSS pixels): dots before lines before polygons. */
export function hitTest(placed: readonly PlacedFeature[], relief: VisibleDepths, [x, y]: Vec2, occlusion: Occlusion): PlacedFeature | null {
  const [low, high] = screenRect(relief);
  const px = (high[0] - low[0]) / relief.camera.width;
  const at: Vec2 = [low[0] + x * px, high[1] - y * px];
  const last = (test: (feature: PlacedFeature) => boolean): PlacedFeature | undefined => placed.findLast(test);
  const onDot = ({ dots, style }: PlacedFeature): boolean =>
    dots.some(
      (dot) =>
        dot.at &&
        !(dot.hidden && occlusion === "hide") &&
        Math.hypot(dot.at[0] - at[0], dot.at[1] - at[1]) <= (style.radius + TOLERANCE_PX) * px,
    );
  const onLine = ({ lines, style }: PlacedFeature): boolean =>
    style.width > 0 && lines.some((line) => isNear(line, at, (style.width / 2 + TOLERANCE_PX) * px, occlusion));
  const inside = ({ polygons, style }: PlacedFeature): boolean =>
    style.fill !== null && polygons.some((polygon) => polygon.covers(relief, at, occlusion));
  return last(onDot) ?? last(onLine) ?? last(inside) ?? null;
}

function isNear({ sections, reach }: FeatureLine, [u, v]: Vec2, tolerance: number, occlusion: Occlusion): boolean {
  if (!reach || u < reach[0][0] - tolerance || v < reach[0][1] - tolerance || u > reach[1][0] + tolerance || v > reach[1][1] + tolerance)
    return false;
  return sections.some(({ uv, hidden }) => {
    if (hidden && occlusion === "hide") return false;
    for (let k = 2; k < uv.length; k += 2)
      if (distance(u, v, uv[k - 2] as number, uv[k - 1] as number, uv[k] as number, uv[k + 1] as number) <= tolerance) return true;
    return false;
  });
}

/** Distance of a point from a segment. */
function distance(u: number, v: number, u0: number, v0: number, u1: number, v1: number): number {
  const [du, dv] = [u1 - u0, v1 - v0];
  const t = Math.min(Math.max(((u - u0) * du + (v - v0) * dv) / (du * du + dv * dv || 1), 0), 1);
  return Math.hypot(u0 + t * du - u, v0 + t * dv - v);
}

/** Returns a point of the screen (CSS pixels) for the label of a feature: a dot, or the middle of its visible lines; null when the feature is not in view. */
export function anchorOf({ dots, lines }: PlacedFeature, relief: VisibleDepths): Vec2 | null {
  const [low, high] = screenRect(relief);
  const px = (high[0] - low[0]) / relief.camera.width;
  const visible: Vec2[] = [];
  const keep = (u: number, v: number): void => {
    if (u >= low[0] && v >= low[1] && u <= high[0] && v <= high[1]) visible.push([(u - low[0]) / px, (high[1] - v) / px]);
  };
  for (const { at, hidden } of dots) if (at && !hidden) keep(at[0], at[1]);
  for (const { reach, sections } of lines) {
    if (visible.length > 0 || !reach) break;
    for (const { uv, hidden } of sections) for (let k = 0; k < uv.length && !hidden; k += 2) keep(uv[k] as number, uv[k + 1] as number);
  }
  return visible[Math.floor(visible.length / 2)] ?? null;
}

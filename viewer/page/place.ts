import type { map, MapOptions, Vec3 } from "./map3d.mjs";

/** The view in the address: `#<direction>/<x>/<y>/<z>/<zoom>`, so that it can be shared. Anything else is ignored. */
export function readPlace(hash: string): Pick<MapOptions, "direction" | "center" | "zoom"> {
  const [direction, ...parts] = decodeURIComponent(hash.replace(/^#/, "")).split("/");
  const numbers = parts.map(Number);
  if (!direction || numbers.length !== 4 || !numbers.every(Number.isFinite)) return {};
  const [x, y, z, zoom] = numbers as [number, number, number, number];
  return { direction, center: [x, y, z] as Vec3, zoom };
}

export function writePlace(view: map): void {
  const { center } = view;
  if (!center) return;
  const place = [view.direction, ...center.map((part) => part.toFixed(1)), view.zoom.toFixed(2)].join("/");
  history.replaceState(null, "", `#${place}`);
}

import { element } from "../core/dom";

/** Lays a copy of a 2D canvas over it that fades: the change of direction where there is no WebGL. */
export function fadeOut(canvas: HTMLCanvasElement, duration_ms: number): void {
  const copy = element("canvas", "", { "aria-hidden": "true", width: String(canvas.width), height: String(canvas.height) });
  copy.style.cssText = `position:absolute;inset:0;width:100%;height:100%;pointer-events:none;background:var(--map3d-background);transition:opacity ${String(duration_ms)}ms`;
  copy.getContext("2d")?.drawImage(canvas, 0, 0);
  canvas.after(copy);
  requestAnimationFrame(() => requestAnimationFrame(() => { copy.style.opacity = "0"; }));
  setTimeout(() => { copy.remove(); }, duration_ms + 100);
}

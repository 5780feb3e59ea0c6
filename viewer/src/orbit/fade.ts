const canvasesOf = (picture: HTMLElement): HTMLCanvasElement[] => (picture instanceof HTMLCanvasElement ? [picture] : [...picture.querySelectorAll("canvas")]);

/** Lays a copy of a picture, a 2D canvas or what holds some, over it that fades: the change of direction where there is no WebGL. */
export function fadeOut(picture: HTMLElement, duration_ms: number): void {
  const copy = picture.cloneNode(true) as HTMLElement;
  const from = canvasesOf(picture);
  canvasesOf(copy).forEach((canvas, k) => {
    if (from[k]?.width) canvas.getContext("2d")?.drawImage(from[k], 0, 0);
  });
  copy.setAttribute("aria-hidden", "true");
  copy.removeAttribute("id"); // the page's own canvas has one
  copy.style.cssText += `;position:absolute;inset:0;width:100%;height:100%;pointer-events:none;background:var(--map3d-background);transition:opacity ${String(duration_ms)}ms`;
  picture.after(copy);
  requestAnimationFrame(() => requestAnimationFrame(() => { copy.style.opacity = "0"; }));
  setTimeout(() => { copy.remove(); }, duration_ms + 100);
}

const listCanvases = (element: HTMLElement): HTMLCanvasElement[] =>
  element instanceof HTMLCanvasElement ? [element] : [...element.querySelectorAll("canvas")];

/** Longest wait for the other view. */
const MAX_WAIT_MS = 2500;

/** Cross-fades a change of view without WebGL: covers the map's 2D canvas, or an element with several, with a copy that fades out. @param waits whether the other view is not shown yet */
export function fadeOut(element: HTMLElement, duration_ms: number, waits: () => boolean): void {
  const copy = element.cloneNode(true) as HTMLElement;
  const originals = listCanvases(element);
  listCanvases(copy).forEach((canvas, k) => {
    if (originals[k]?.width) canvas.getContext("2d")?.drawImage(originals[k], 0, 0);
  });
  copy.setAttribute("aria-hidden", "true");
  copy.removeAttribute("id"); // the page's canvas can have an id
  copy.style.cssText += `;position:absolute;inset:0;width:100%;height:100%;pointer-events:none;background:var(--map3d-background);transition:opacity ${String(duration_ms)}ms`;
  element.after(copy);
  const end_ms = performance.now() + MAX_WAIT_MS;
  const fade = (): void => {
    if (waits() && performance.now() < end_ms) {
      requestAnimationFrame(fade);
      return;
    }
    copy.style.opacity = "0";
    setTimeout(() => copy.remove(), duration_ms + 100);
  };
  requestAnimationFrame(() => requestAnimationFrame(fade));
}

import type { Vec2 } from "./vec";

type Child = Node | string;

/** Creates an element; strings among its children become text, never HTML. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  classes: string,
  attributes: Record<string, string> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const created = document.createElement(tag);
  if (classes) created.className = classes;
  for (const [name, value] of Object.entries(attributes)) created.setAttribute(name, value);
  created.append(...children);
  return created;
}

/** Creates a button with an icon, an SVG path (24 × 24, stroked), and an accessible name. */
export function iconButton(classes: string, label: string, path: string): HTMLButtonElement {
  const button = element("button", classes, { type: "button", "aria-label": label, title: label });
  button.append(icon(path));
  return button;
}

export function icon(path: string): SVGSVGElement {
  const ns = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(ns, "svg");
  for (const [name, value] of Object.entries({ viewBox: "0 0 24 24", "aria-hidden": "true", class: "map3d-icon" }))
    svg.setAttribute(name, value);
  const line = document.createElementNS(ns, "path");
  line.setAttribute("d", path);
  svg.append(line);
  return svg;
}

/** Returns where a pointer event is in an element's own CSS pixels, from its top left corner: a `transform` or `zoom` of the page does not count. */
export function positionIn(target: HTMLElement, event: MouseEvent): Vec2 {
  let own = event;
  if (event.target !== target) {
    // Browsers compute the offset from an event's target, through all transforms.
    own = new PointerEvent("map3d-position", { clientX: event.clientX, clientY: event.clientY });
    target.dispatchEvent(own);
  }
  const { currentCSSZoom = 1 } = target as { readonly currentCSSZoom?: number };
  return [own.offsetX / currentCSSZoom, own.offsetY / currentCSSZoom];
}

const adopted = new WeakMap<Document, Set<string>>();

/** Adds a style sheet to a document, once. A constructed sheet, which a CSP without inline styles allows. */
export function adoptStyles(document: Document, css: string): void {
  const known = adopted.get(document) ?? new Set();
  if (known.has(css)) return;
  adopted.set(document, known.add(css));
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(css);
  document.adoptedStyleSheets = [sheet, ...document.adoptedStyleSheets];
}

/** Whether the user prefers reduced motion. */
export const prefersReducedMotion = (): boolean => matchMedia("(prefers-reduced-motion: reduce)").matches;

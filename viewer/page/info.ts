import type { Attribute, ClickEvent } from "./map3d.mjs";
import { withText } from "./dom";
import { language, message } from "./i18n";

/** Shows the selected object's name, position and attributes, as text. */
export class InfoPanel {
  units: { crs: string; vertical: string | null } = { crs: "", vertical: null };
  readonly #box: HTMLElement;
  readonly #onClose: () => void;

  constructor(box: HTMLElement, onClose: () => void) {
    this.#box = box;
    this.#onClose = onClose;
    addEventListener("keydown", (event) => {
      if (event.key === "Escape" && !box.hidden) this.close();
    });
  }

  close(): void {
    this.#box.hidden = true;
    this.#onClose();
  }

  /** @param showBack shows the object from behind */
  show(event: ClickEvent, showBack?: () => void): void {
    const attributes = Object.entries(event.attributes ?? {}).map(([name, value]) => [name, formatValue(value)] as const);
    const rows = [...this.#positionRows(event), ...attributes.filter(([, text]) => text !== "")];
    const list = document.createElement("dl");
    for (const [name, value] of rows) list.append(withText("dt", name), withText("dd", value));
    const kind = [event.class, event.id > 0 ? `id ${String(event.id)}` : "", event.approximate ? message("approximate") : ""];
    const title = withText("h2", event.name ?? (event.id > 0 ? `${message("object")} ${String(event.id)}` : message("point")));
    this.#box.replaceChildren(title, ...(showBack ? [behindButton(showBack)] : []), withText("p", kind.filter(Boolean).join(" · "), "note"), list, this.#closeButton());
    this.#box.hidden = false;
    this.#box.scrollTop = 0;
  }

  #positionRows({ position }: ClickEvent): (readonly [string, string])[] {
    if (!position) return [];
    const [x, y, z] = position.map((part) => part.toLocaleString(language, { ...PLAIN, minimumFractionDigits: 2, maximumFractionDigits: 2 }));
    const height = this.units.vertical ? ` (${this.units.vertical})` : "";
    return [
      [message("position"), `${x ?? ""}${(x ?? "").includes(",") ? ";" : ","} ${y ?? ""}`],
      [message("height"), `${z ?? ""} m${height}`],
    ];
  }

  #closeButton(): HTMLButtonElement {
    const button = withText("button", "", "close");
    button.type = "button";
    button.setAttribute("aria-label", message("close"));
    const ns = "http://www.w3.org/2000/svg";
    const [svg, path] = [document.createElementNS(ns, "svg"), document.createElementNS(ns, "path")];
    svg.setAttribute("viewBox", "0 0 24 24");
    path.setAttribute("d", "M6 6l12 12M18 6L6 18");
    svg.append(path);
    button.append(svg);
    button.addEventListener("click", () => {
      this.close();
    });
    return button;
  }
}

function behindButton(showBack: () => void): HTMLButtonElement {
  const button = withText("button", message("showBack"), "behind");
  button.type = "button";
  button.addEventListener("click", showBack);
  return button;
}

/** Years and numbers of houses have no separators of thousands. */
const PLAIN = { useGrouping: false, maximumFractionDigits: 12 } as const;

function formatValue(value: Attribute): string {
  if (value === null) return "–";
  if (typeof value === "number") return value.toLocaleString(language, PLAIN);
  return typeof value === "boolean" ? message(value ? "yes" : "no") : value;
}

import type { Attribute, ClickEvent } from "./map3d.mjs";
import { withText } from "./dom";
import { say } from "./i18n";

/** What is known of the chosen object. All of it is text. */
export class InfoPanel {
  units: { crs: string; vertical: string | null } = { crs: "", vertical: null };
  readonly #box: HTMLElement;
  readonly #closed: () => void;

  constructor(box: HTMLElement, closed: () => void) {
    this.#box = box;
    this.#closed = closed;
    addEventListener("keydown", (event) => {
      if (event.key === "Escape" && !box.hidden) this.close();
    });
  }

  close(): void {
    this.#box.hidden = true;
    this.#closed();
  }

  /** @param behind shows the object from the other side */
  show(event: ClickEvent, behind?: () => void): void {
    const rows = [...this.#places(event), ...Object.entries(event.attributes ?? {}).map(([name, value]) => [name, written(value)] as const)];
    const list = document.createElement("dl");
    for (const [name, value] of rows) list.append(withText("dt", name), withText("dd", value));
    const kind = [event.class, event.id > 0 ? `id ${String(event.id)}` : "", event.approximate ? say("approximate") : ""];
    const title = withText("h2", event.name ?? (event.id > 0 ? `${say("object")} ${String(event.id)}` : say("point")));
    this.#box.replaceChildren(title, ...(behind ? [behindButton(behind)] : []), withText("p", kind.filter(Boolean).join(" · "), "note"), list, this.#closeButton());
    this.#box.hidden = false;
    this.#box.scrollTop = 0;
  }

  #places({ position }: ClickEvent): (readonly [string, string])[] {
    if (!position) return [];
    const [x, y, z] = position.map((part) => part.toFixed(2));
    const height = this.units.vertical ? ` (${this.units.vertical})` : "";
    return [
      [say("position"), `${x ?? ""}, ${y ?? ""}`],
      [say("height"), `${z ?? ""} m${height}`],
    ];
  }

  #closeButton(): HTMLButtonElement {
    const button = withText("button", "", "close");
    button.type = "button";
    button.setAttribute("aria-label", say("close"));
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

function behindButton(behind: () => void): HTMLButtonElement {
  const button = withText("button", say("behind"), "behind");
  button.type = "button";
  button.addEventListener("click", behind);
  return button;
}

function written(value: Attribute): string {
  if (value === null) return "–";
  return typeof value === "boolean" ? say(value ? "yes" : "no") : String(value);
}

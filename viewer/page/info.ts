import type { ClickEvent, Vec3 } from "./map3d.module.js";
import { describe, type Card, type Units } from "./card";
import { withText } from "./dom";
import { message } from "./i18n";
import { report, toast } from "./toast";

/** Shows the selected object's name, position and attributes, as text. */
export class InfoPanel {
  units: Units = { crs: "", vertical: null };
  /** Returns longitude and latitude of a world position, where known. */
  lonLat: (position: Vec3) => readonly [number, number] | null = () => null;
  readonly #box: HTMLElement;
  readonly #onClose: () => void;

  constructor(box: HTMLElement, onClose: () => void) {
    this.#box = box;
    this.#onClose = onClose;
    addEventListener("keydown", (event) => {
      if (event.key === "Escape" && !box.hidden) this.close();
    });
  }

  /** Its place on the screen, CSS pixels. */
  get bounds(): DOMRect {
    return this.#box.getBoundingClientRect();
  }

  close(): void {
    this.#box.hidden = true;
    this.#onClose();
  }

  /** Returns the title. @param showBack shows the object from behind */
  show(event: ClickEvent, showBack?: () => void): string {
    const card = describe(event, this.units, event.position && this.lonLat(event.position));
    const all = withText("details", "");
    all.append(withText("summary", message("allData")), listOf(card.details), copyButton(card));
    this.#box.replaceChildren(
      withText("h2", card.title),
      ...(showBack ? [behindButton(showBack)] : []),
      withText("p", card.note, "note"),
      listOf(card.rows),
      all,
      this.#closeButton(),
    );
    this.#box.hidden = false;
    this.#box.scrollTop = 0;
    return card.title;
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
    button.addEventListener("click", () => this.close());
    return button;
  }
}

function behindButton(showBack: () => void): HTMLButtonElement {
  const button = withText("button", message("showBack"), "behind");
  button.type = "button";
  button.addEventListener("click", showBack);
  return button;
}

function listOf(rows: Card["rows"]): HTMLElement {
  const list = document.createElement("dl");
  for (const [name, value] of rows) list.append(withText("dt", name), withText("dd", value));
  return list;
}

/** A button that copies the card as text, a line for each row. */
function copyButton({ title, rows, details }: Card): HTMLButtonElement {
  const button = withText("button", message("copy"), "copy");
  button.type = "button";
  button.addEventListener("click", () => {
    const text = [title, ...[...rows, ...details].map(([name, value]) => `${name}\t${value}`)].join("\n");
    navigator.clipboard.writeText(text).then(
      () => toast(message("copied")),
      (reason: unknown) => report(reason),
    );
  });
  return button;
}

import type { ImageLayer, Map3D, SearchEntry, Vec3 } from "./map3d.module.js";
import { nameOfResult } from "./card";
import { byId, inputById, withText } from "./dom";
import { toast } from "./toast";
import { introduce, message } from "./i18n";

const ZOOM_BELOW_DEEPEST = 1;

/** Binds the search box: a combobox over the rendering's search index, of which the first search fetches a part. @param goTo selects the object that the user chooses and flies there */
export function bindSearch(view: Map3D, layer: () => ImageLayer, goTo: (id: number, position: Vec3, zoom: number) => void): void {
  const [form, query, list] = [byId("search"), inputById("query"), byId("results")];
  const box = new SearchBox(
    query,
    list,
    (text) => layer().search(text),
    (entry) => go(view, layer(), entry, goTo),
  );
  form.hidden = false;
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    box.choose();
  });
}

function go(view: Map3D, layer: ImageLayer, [id, , local]: SearchEntry, goTo: (id: number, position: Vec3, zoom: number) => void): void {
  const json = layer.rendering?.json;
  if (!json) return;
  const world = [json.origin[0] + local[0], json.origin[1] + local[1], json.origin[2] + local[2]] as const satisfies Vec3;
  goTo(id, world, Math.max(view.zoom, json.zmax - ZOOM_BELOW_DEEPEST));
}

class SearchBox {
  readonly #query: HTMLInputElement;
  readonly #list: HTMLElement;
  readonly #find: (text: string) => Promise<readonly SearchEntry[]>;
  readonly #select: (entry: SearchEntry) => void;
  #hits: readonly SearchEntry[] = [];
  #at = 0;

  constructor(
    query: HTMLInputElement,
    list: HTMLElement,
    find: (text: string) => Promise<readonly SearchEntry[]>,
    select: (entry: SearchEntry) => void,
  ) {
    [this.#query, this.#list, this.#find, this.#select] = [query, list, find, select];
    query.addEventListener("input", () => void this.#update());
    query.addEventListener("focus", () => void this.#update());
    query.addEventListener("blur", () => this.#show(false));
    query.addEventListener("keydown", (event) => this.#key(event));
  }

  choose(at = this.#at): void {
    const hit = this.#hits[at];
    if (!hit) return;
    this.#query.value = nameOfResult(hit[1]);
    this.#query.blur();
    this.#select(hit);
  }

  async #update(): Promise<void> {
    try {
      const text = this.#query.value;
      const hits = await this.#find(text);
      if (text !== this.#query.value) return;
      this.#hits = hits;
      this.#at = 0;
      this.#render();
    } catch (reason) {
      toast(introduce("searchFailed", reason));
    }
  }

  #render(): void {
    const rows = this.#hits.map((hit, k) => this.#row(hit, k));
    this.#list.replaceChildren(...(rows.length > 0 ? rows : [withText("li", message("noResults"), "none")]));
    this.#show(this.#query.value.trim() !== "" && document.activeElement === this.#query);
  }

  #row([, label]: SearchEntry, k: number): HTMLElement {
    const row = withText("li", nameOfResult(label));
    row.id = `result-${String(k)}`;
    row.setAttribute("role", "option");
    row.setAttribute("aria-selected", String(k === this.#at));
    row.addEventListener("pointerdown", (event) => {
      event.preventDefault(); // keeps the focus in the search box until the click
    });
    row.addEventListener("click", () => this.choose(k));
    return row;
  }

  #show(shown: boolean): void {
    this.#list.hidden = !shown;
    this.#query.setAttribute("aria-expanded", String(shown));
    if (shown && this.#hits.length > 0) this.#query.setAttribute("aria-activedescendant", `result-${String(this.#at)}`);
    else this.#query.removeAttribute("aria-activedescendant");
  }

  #key(event: KeyboardEvent): void {
    const step = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    if (event.key === "Escape") this.#query.blur();
    if (step === 0 || this.#hits.length === 0) return;
    event.preventDefault();
    this.#at = (this.#at + step + this.#hits.length) % this.#hits.length;
    this.#render();
  }
}

import { marker, type imageLayer, type map, type SearchEntry, type Vec3 } from "./map3d.mjs";
import { byId, inputById, withText } from "./dom";
import { toast } from "./toast";
import { message } from "./i18n";

const MAX_RESULTS = 8;
const ZOOM_BELOW_DEEPEST = 1;

/** Lower case without accents, so that "strasse" matches "Straße" and "cafe" matches "Café". */
export function normalize(text: string): string {
  return text.toLowerCase().replaceAll("ß", "ss").normalize("NFD").replace(/\p{M}/gu, "");
}

/** Returns the first entries that contain all words; those that begin with the first word come first. */
export function findEntries(entries: readonly SearchEntry[], text: string): SearchEntry[] {
  const words = normalize(text).split(/\s+/).filter(Boolean);
  if (words.length === 0) return [];
  const hits = entries.filter(([, label]) => {
    const name = normalize(label);
    return words.every((word) => name.includes(word));
  });
  const start = (entry: SearchEntry): number => (normalize(entry[1]).startsWith(words[0] ?? "") ? 0 : 1);
  return hits.sort((a, b) => start(a) - start(b)).slice(0, MAX_RESULTS);
}

/** Binds the search box: a combobox over the rendering's search index, which is fetched on first use. */
export function bindSearch(view: map, layer: () => imageLayer, select: (id: number, position: Vec3) => void): void {
  const [form, query, list] = [byId("search"), inputById("query"), byId("results")];
  const box = new SearchBox(query, list, () => layer().searchIndex(), (entry) => {
    go(view, layer(), entry, select);
  });
  form.hidden = false;
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    box.choose();
  });
}

let pin: marker | undefined;

function go(view: map, layer: imageLayer, [id, label, local]: SearchEntry, select: (id: number, position: Vec3) => void): void {
  const json = layer.rendering?.json;
  if (!json) return;
  const world = [json.origin[0] + local[0], json.origin[1] + local[1], json.origin[2] + local[2]] as const satisfies Vec3;
  pin?.remove();
  pin = new marker(label, world).addTo(view).select();
  select(id, world);
  view.flyTo(world, Math.max(view.zoom, json.zmax - ZOOM_BELOW_DEEPEST));
}

class SearchBox {
  readonly #query: HTMLInputElement;
  readonly #list: HTMLElement;
  readonly #entries: () => Promise<readonly SearchEntry[]>;
  readonly #select: (entry: SearchEntry) => void;
  #hits: SearchEntry[] = [];
  #at = 0;

  constructor(query: HTMLInputElement, list: HTMLElement, entries: () => Promise<readonly SearchEntry[]>, select: (entry: SearchEntry) => void) {
    [this.#query, this.#list, this.#entries, this.#select] = [query, list, entries, select];
    query.addEventListener("input", () => void this.#update());
    query.addEventListener("focus", () => void this.#update());
    query.addEventListener("blur", () => {
      this.#show(false);
    });
    query.addEventListener("keydown", (event) => {
      this.#key(event);
    });
  }

  choose(at = this.#at): void {
    const hit = this.#hits[at];
    if (!hit) return;
    this.#query.value = hit[1];
    this.#query.blur();
    this.#select(hit);
  }

  async #update(): Promise<void> {
    try {
      const entries = await this.#entries();
      this.#hits = findEntries(entries, this.#query.value);
      this.#at = 0;
      this.#render();
    } catch (reason) {
      toast(`${message("searchFailed")}: ${reason instanceof Error ? reason.message : String(reason)}`);
    }
  }

  #render(): void {
    const rows = this.#hits.map((hit, k) => this.#row(hit, k));
    this.#list.replaceChildren(...(rows.length > 0 ? rows : [withText("li", message("noResults"), "none")]));
    this.#show(this.#query.value.trim() !== "" && document.activeElement === this.#query);
  }

  #row([, label]: SearchEntry, k: number): HTMLElement {
    const row = withText("li", label);
    row.id = `result-${String(k)}`;
    row.setAttribute("role", "option");
    row.setAttribute("aria-selected", String(k === this.#at));
    row.addEventListener("pointerdown", (event) => {
      event.preventDefault(); // keeps the focus in the search box until the click
    });
    row.addEventListener("click", () => {
      this.choose(k);
    });
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

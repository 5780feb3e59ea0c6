import type { map } from "./map3d.mjs";
import type { AreaProgress, DownloadOptions, StoredArea } from "./map3d-offline.mjs";
import { byId, withText } from "./dom";
import { toast } from "./messages";
import { language, say } from "./i18n";

type Offline = typeof import("./map3d-offline.mjs");

/** What this page loads, now or when it is asked to. */
export const PAGE_FILES = ["page.js", "page.css", "map3d.mjs", ...["compare", "controls", "measure", "offline", "orbit", "print", "shade", "theme"].map((name) => `map3d-${name}.mjs`)];

/** A dialog that keeps what is in view for times without a network. Nothing is stored before it is asked for. */
export function bindOffline(view: map, name: string): void {
  if (!isSecureContext || !("serviceWorker" in navigator)) return;
  const [button, dialog, details] = [byId("keep"), byId("offline") as HTMLDialogElement, byId("offline-details") as HTMLSelectElement];
  button.hidden = false;
  button.addEventListener("click", () => {
    import("./map3d-offline.mjs").then((offline) => {
      shown ??= new Shown(view, name, offline, dialog, details);
      shown.open();
    }, (reason: unknown) => { toast(`${say("noTool")}: ${String(reason)}`); });
  });
  let shown: Shown | undefined;
}

class Shown {
  readonly #view: map;
  readonly #name: string;
  readonly #offline: Offline;
  readonly #dialog: HTMLDialogElement;
  readonly #details: HTMLSelectElement;
  #keeping: AbortController | undefined;
  #asked = 0;

  constructor(view: map, name: string, offline: Offline, dialog: HTMLDialogElement, details: HTMLSelectElement) {
    [this.#view, this.#name, this.#offline, this.#dialog, this.#details] = [view, name, offline, dialog, details];
    details.addEventListener("change", () => void this.#estimate());
    dialog.addEventListener("close", () => {
      this.#asked++;
      this.#keeping?.abort();
    });
    byId("offline-keep").addEventListener("click", () => void this.#keep({ name: `${this.#name} ${new Date().toISOString()}`, ...this.#wanted() }));
  }

  open(): void {
    this.#fail("");
    this.#work(false);
    this.#dialog.showModal();
    void this.#list();
    void this.#estimate();
  }

  /** All levels, or those up to what the screen shows. */
  #wanted(): DownloadOptions {
    const { zoom } = this.#view;
    return this.#details.value === "all" ? {} : { levels: [0, Math.max(0, Math.ceil(zoom + Math.log2(devicePixelRatio)))] };
  }

  async #estimate(): Promise<void> {
    const at = ++this.#asked;
    const [note, keep] = [byId("offline-note"), byId("offline-keep") as HTMLButtonElement];
    [note.textContent, keep.disabled] = ["…", true];
    try {
      const { bytes, free_bytes } = await this.#offline.estimateArea(this.#view, this.#wanted());
      if (at !== this.#asked) return;
      keep.disabled = free_bytes !== null && bytes > free_bytes;
      note.textContent = `≈ ${size(bytes)}${free_bytes === null ? "" : ` · ${say("room").replace("%", size(free_bytes))}`}`;
    } catch (reason) {
      if (at !== this.#asked) return;
      note.textContent = "";
      this.#fail(`${say("notKept")}: ${reason instanceof Error ? reason.message : String(reason)}`);
    }
  }

  async #keep(options: DownloadOptions): Promise<void> {
    const { signal } = (this.#keeping = new AbortController());
    this.#fail("");
    this.#work(true);
    try {
      await this.#offline.registerWorker();
      await this.#offline.downloadArea(this.#view, { ...options, files: [location.pathname, ...PAGE_FILES], signal, onProgress: progressBar() });
      toast(say("kept"));
      this.#dialog.close();
    } catch (reason) {
      if (!signal.aborted) this.#fail(`${say("notKept")}: ${reason instanceof Error ? reason.message : String(reason)}`);
    }
    this.#work(false);
    await this.#list();
  }

  async #list(): Promise<void> {
    const areas = await this.#offline.listAreas();
    byId("offline-kept").replaceChildren(...areas.map((area) => this.#row(area)));
  }

  #row(area: StoredArea): HTMLElement {
    const date = new Date(area.stored).toLocaleString(language, { dateStyle: "medium", timeStyle: "short" });
    const row = withText("li", "");
    const what = withText("span", area.title);
    what.append(withText("small", `${date} · ${area.complete ? size(area.bytes) : say("begun")}`));
    row.append(what);
    if (!area.complete) row.append(action(say("goOn"), `${say("goOn")}: ${date}`, () => void this.#keep(area)));
    row.append(action(say("remove"), `${say("remove")}: ${date}`, () => void this.#remove(area.name)));
    return row;
  }

  async #remove(name: string): Promise<void> {
    await this.#offline.removeArea(name);
    if ((await this.#offline.listAreas()).length === 0) await (await navigator.serviceWorker.getRegistration())?.unregister();
    await this.#list();
    await this.#estimate();
  }

  #fail(text: string): void {
    byId("offline-failed").textContent = text;
    byId("offline-failed").hidden = text === "";
  }

  #work(on: boolean): void {
    byId("offline-working").hidden = !on;
    byId("offline-kept").hidden = on;
    for (const element of [byId("offline-keep"), this.#details]) (element as HTMLButtonElement | HTMLSelectElement).disabled = on;
    showProgress(0, "");
  }
}

/** Share, rate and time left of this run: what was kept before counts as done, not as speed. */
function progressBar(): (progress: AreaProgress) => void {
  const start = performance.now();
  return ({ done, total, bytes }) => {
    const seconds = (performance.now() - start) / 1000;
    const left = (seconds * (total - done)) / done;
    const time = left < 90 ? unit(Math.ceil(left), "second") : unit(Math.ceil(left / 60), "minute");
    showProgress(done / total, seconds < 1 ? "" : [unit(bytes / 1e6 / seconds, "megabyte-per-second", 1), say("timeLeft").replace("%", time)].join(" · "));
  };
}

function showProgress(share: number, text: string): void {
  (byId("offline-progress") as HTMLProgressElement).value = share;
  byId("offline-share").textContent = [share.toLocaleString(language, { style: "percent" }), text].filter(Boolean).join(" · ");
}

function action(text: string, label: string, act: () => void): HTMLElement {
  const button = withText("button", text);
  button.type = "button";
  button.setAttribute("aria-label", label);
  button.addEventListener("click", act);
  return button;
}

const unit = (value: number, name: string, maximumFractionDigits = 0): string => value.toLocaleString(language, { style: "unit", unit: name, maximumFractionDigits });
const size = (bytes: number): string => (bytes < 1e9 ? unit(bytes / 1e6, "megabyte", bytes < 1e7 ? 1 : 0) : unit(bytes / 1e9, "gigabyte", bytes < 1e10 ? 1 : 0));

import type { Map3D } from "./map3d.module.js";
import type { AreaProgress, DownloadOptions, StoredArea } from "./map3d-offline.module.js";
import { byId, withText } from "./dom";
import { toast } from "./toast";
import { language, introduce, message } from "./i18n";

type Offline = typeof import("./map3d-offline.module.js");

/** All files that this page loads, at once or on demand. */
export const PAGE_FILES = [
  "start.js",
  "page.js",
  "page-share.js",
  "page.css",
  "map3d.module.js",
  ...["compare", "controls", "measure", "offline", "orbit", "print", "shade", "theme"].map((name) => `map3d-${name}.module.js`),
];

/** Binds the dialog that saves the current view for offline use. Stores nothing until the user saves an area. */
export function bindOffline(view: Map3D, name: string): void {
  if (!isSecureContext || !("serviceWorker" in navigator)) return;
  const [button, dialog, details] = [
    byId("save-offline"),
    byId("offline") as HTMLDialogElement,
    byId("offline-details") as HTMLSelectElement,
  ];
  button.hidden = false;
  button.addEventListener("click", () => {
    import("./map3d-offline.module.js").then(
      (offline) => {
        opened ??= new OfflineDialog(view, name, offline, dialog, details);
        opened.open();
      },
      (reason: unknown) => toast(introduce("toolFailed", reason)),
    );
  });
  let opened: OfflineDialog | undefined;
}

class OfflineDialog {
  readonly #view: Map3D;
  readonly #name: string;
  readonly #offline: Offline;
  readonly #dialog: HTMLDialogElement;
  readonly #details: HTMLSelectElement;
  #download: AbortController | undefined;
  #request = 0;

  constructor(view: Map3D, name: string, offline: Offline, dialog: HTMLDialogElement, details: HTMLSelectElement) {
    [this.#view, this.#name, this.#offline, this.#dialog, this.#details] = [view, name, offline, dialog, details];
    details.addEventListener("change", () => void this.#estimate());
    dialog.addEventListener("close", () => {
      this.#request++;
      this.#download?.abort();
    });
    byId("offline-save").addEventListener(
      "click",
      () => void this.#save({ name: `${this.#name} ${new Date().toISOString()}`, ...this.#downloadOptions() }),
    );
  }

  open(): void {
    this.#showError("");
    this.#setBusy(false);
    this.#dialog.showModal();
    void this.#list();
    void this.#estimate();
  }

  /** All levels, or those up to the level on screen. */
  #downloadOptions(): DownloadOptions {
    const { zoom } = this.#view;
    return this.#details.value === "all" ? {} : { levels: [0, Math.max(0, Math.ceil(zoom + Math.log2(devicePixelRatio)))] };
  }

  async #estimate(): Promise<void> {
    const request = ++this.#request;
    const [note, save] = [byId("offline-note"), byId("offline-save") as HTMLButtonElement];
    [note.textContent, save.disabled] = ["…", true];
    try {
      const { bytes, free_bytes } = await this.#offline.estimateArea(this.#view, this.#downloadOptions());
      if (request !== this.#request) return;
      save.disabled = free_bytes !== null && bytes > free_bytes;
      note.textContent = `≈ ${size(bytes)}${free_bytes === null ? "" : ` · ${message("freeSpace").replace("%", size(free_bytes))}`}`;
    } catch (reason) {
      if (request !== this.#request) return;
      note.textContent = "";
      this.#showError(introduce("saveFailed", reason));
    }
  }

  async #save(options: DownloadOptions): Promise<void> {
    const { signal } = (this.#download = new AbortController());
    this.#showError("");
    this.#setBusy(true);
    try {
      await this.#offline.registerWorker();
      await this.#offline.downloadArea(this.#view, {
        ...options,
        files: [location.pathname, ...PAGE_FILES],
        signal,
        onProgress: progressBar(),
      });
      toast(message("saved"));
      this.#dialog.close();
    } catch (reason) {
      if (!signal.aborted) this.#showError(introduce("saveFailed", reason));
    }
    this.#setBusy(false);
    await this.#list();
  }

  async #list(): Promise<void> {
    const areas = await this.#offline.listAreas();
    byId("offline-areas").replaceChildren(...areas.map((area) => this.#row(area)));
  }

  #row(area: StoredArea): HTMLElement {
    const date = new Date(area.stored).toLocaleString(language, { dateStyle: "medium", timeStyle: "short" });
    const row = withText("li", "");
    const title = withText("span", area.title);
    title.append(withText("small", `${date} · ${area.complete ? size(area.bytes) : message("partial")}`));
    row.append(title);
    if (!area.complete) row.append(action(message("resume"), introduce("resume", date), () => void this.#save(area)));
    row.append(action(message("delete"), introduce("delete", date), () => void this.#remove(area.name)));
    return row;
  }

  async #remove(name: string): Promise<void> {
    await this.#offline.removeArea(name);
    if ((await this.#offline.listAreas()).length === 0) await (await navigator.serviceWorker.getRegistration())?.unregister();
    await this.#list();
    await this.#estimate();
  }

  #showError(text: string): void {
    byId("offline-failed").textContent = text;
    byId("offline-failed").hidden = text === "";
  }

  #setBusy(busy: boolean): void {
    byId("offline-busy").hidden = !busy;
    byId("offline-areas").hidden = busy;
    for (const element of [byId("offline-save"), this.#details]) (element as HTMLButtonElement | HTMLSelectElement).disabled = busy;
    showProgress(0, "");
  }
}

/** Shows percentage, rate and time left. Tiles saved by an earlier run count as done, but not towards the rate. */
function progressBar(): (progress: AreaProgress) => void {
  const start = performance.now();
  return ({ done, total, bytes }) => {
    const seconds = (performance.now() - start) / 1000;
    const seconds_left = (seconds * (total - done)) / done;
    const time = seconds_left < 90 ? unit(Math.ceil(seconds_left), "second") : unit(Math.ceil(seconds_left / 60), "minute");
    showProgress(
      done / total,
      seconds < 1 ? "" : [unit(bytes / 1e6 / seconds, "megabyte-per-second", 1), message("timeLeft").replace("%", time)].join(" · "),
    );
  };
}

function showProgress(fraction: number, text: string): void {
  (byId("offline-progress") as HTMLProgressElement).value = fraction;
  byId("offline-percent").textContent = [fraction.toLocaleString(language, { style: "percent" }), text].filter(Boolean).join(" · ");
}

function action(text: string, label: string, onClick: () => void): HTMLElement {
  const button = withText("button", text);
  button.type = "button";
  button.setAttribute("aria-label", label);
  button.addEventListener("click", onClick);
  return button;
}

const unit = (value: number, name: string, maximumFractionDigits = 0): string =>
  value.toLocaleString(language, { style: "unit", unit: name, maximumFractionDigits });
const size = (bytes: number): string =>
  bytes < 1e9 ? unit(bytes / 1e6, "megabyte", bytes < 1e7 ? 1 : 0) : unit(bytes / 1e9, "gigabyte", bytes < 1e10 ? 1 : 0);

import { addPanelButton } from "../core/panelButton";
import { adoptStyles, element, iconButton } from "../core/dom";
import { asError } from "../core/errors";
import { add } from "../core/vec";
import { MapLayer, ImageLayer, type ImageLayerOptions, type Map3D } from "../map3d";
import { FilesError, filesSource, joinPaths } from "./filesSource";
import { DroppedEntries, MANIFEST, type Folder } from "./folder";
import { STYLES } from "./styles";
import { getFilesMessages } from "./i18n";

/** Options of `dropFiles`. */
export interface DropOptions {
  /** BCP 47 tag. Default: the map's. */
  language?: string;
  /** Adds a button that opens the browser's file chooser. Default true. */
  button?: boolean;
  /** Element that accepts drops. Default: the map. */
  target?: HTMLElement;
  /** Options of the new layer. Default: those of an image layer. */
  layer?: ImageLayerOptions;
  /** Layer that the first opened folder replaces. Default: none, so that the folder is added to the map's layers. */
  instead?: ImageLayer;
}

/** Events of `dropFiles`. */
export interface DropEvents {
  /** A folder was dropped or chosen, and is on the map. */
  dropped: { layer: ImageLayer };
  /** The files cannot be shown, and the map is unchanged. The message is shown beside the button, too. */
  error: { error: Error };
}

const FOLDER = "M3 7a2 2 0 0 1 2-2h4l2 2h8a2 2 0 0 1 2 2v8a2 2 0 0 1-2 2H5a2 2 0 0 1-2-2zM12 10.5v5M9.5 13h5";
const MESSAGE_MS = 12_000;

/** Shows a published folder that is dropped on the map or chosen with a button. Each opened folder replaces the previous one. */
export class DropFiles extends MapLayer<Map3D, DropEvents> {
  readonly options: DropOptions;
  readonly #status = element("p", "map3d-status", { role: "status" });
  readonly #input = element("input", "", { type: "file", multiple: "", webkitdirectory: "", hidden: "", tabindex: "-1" });
  readonly #over = element("div", "map3d-drop", { "aria-hidden": "true" });
  #box: HTMLElement | undefined;
  #listeners = new AbortController();
  #layer: ImageLayer | undefined;
  #request = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(options: DropOptions = {}) {
    super();
    this.options = options;
    this.#input.addEventListener("change", () => {
      void this.#openAndReport(Promise.resolve([...(this.#input.files ?? [])]));
      this.#input.value = "";
    });
  }

  /** The layer of the folder that was opened last; undefined before. */
  get layer(): ImageLayer | undefined {
    return this.#layer;
  }

  /** Opens files as if they were dropped. On an error the map is unchanged. @throws FilesError, ManifestError, FetchError or DecodeError */
  async open(files: Iterable<File> | Folder): Promise<ImageLayer> {
    const request = ++this.#request;
    const source = filesSource(files);
    await source.manifest();
    const map = this.map;
    if (!map || request !== this.#request)
      throw new DOMException("other files were opened in the meantime, or the map was removed", "AbortError");
    const [before, layer] = [this.#layer ?? this.options.instead, new ImageLayer(source, this.options.layer)];
    before?.remove();
    if (map.layers.length === 0) map.resetView();
    try {
      await addLayer(layer, map);
    } catch (reason) {
      layer.remove();
      before?.addTo(map);
      throw reason;
    }
    this.#layer = layer;
    fitToLayer(map, layer);
    this.fire("dropped", { layer });
    return layer;
  }

  protected onAdd(map: Map3D): void {
    adoptStyles(document, STYLES);
    const messages = getFilesMessages(this.options.language ?? map.language);
    this.#over.textContent = messages.drop;
    this.#input.setAttribute("aria-label", messages.open);
    map.container.append(this.#over, this.#input);
    if (this.options.button ?? true) {
      const button = iconButton("", messages.open, FOLDER);
      button.addEventListener("click", () => this.#input.click());
      this.#box = addPanelButton(map, button, this.#status);
    }
    this.#listeners = new AbortController();
    this.#listen(this.options.target ?? map.container, this.#listeners.signal);
  }

  protected onRemove(): void {
    this.#request++;
    this.#listeners.abort();
    this.#say("");
    for (const part of [this.#box, this.#over, this.#input]) part?.remove();
    this.#layer?.remove();
    this.#layer = undefined;
  }

  #listen(target: HTMLElement, signal: AbortSignal): void {
    const over = (active: boolean): unknown => this.#over.toggleAttribute("data-over", active);
    const listen = (type: "dragenter" | "dragover" | "drop", handle: (event: DragEvent) => void): void => {
      target.addEventListener(
        type,
        (event) => {
          if (event.dataTransfer?.types.includes("Files") === true) handle(event);
        },
        { signal },
      );
    };
    for (const type of ["dragenter", "dragover"] as const) {
      listen(type, (event) => {
        event.preventDefault();
        if (event.dataTransfer) event.dataTransfer.dropEffect = "copy";
        over(true);
      });
    }
    target.addEventListener(
      "dragleave",
      ({ relatedTarget }) => {
        if (!target.contains(relatedTarget as Node | null)) over(false);
      },
      { signal },
    );
    listen("drop", (event) => {
      event.preventDefault();
      over(false);
      if (event.dataTransfer) void this.#openAndReport(filesOf(event.dataTransfer));
    });
  }

  async #openAndReport(files: Promise<Iterable<File> | Folder>): Promise<void> {
    this.#say("");
    try {
      await this.open(await files);
    } catch (reason) {
      const error = asError(reason);
      if (error.name !== "AbortError") this.#fail(error);
    }
  }

  #fail(error: Error): void {
    const messages = getFilesMessages(this.options.language ?? this.map?.language ?? "en");
    this.#say(error instanceof FilesError ? messages[error.problem](joinPaths(error.paths)) : `${messages.failed}: ${error.message}`);
    this.#timer = setTimeout(() => this.#say(""), MESSAGE_MS);
    this.fire("error", { error });
  }

  #say(text: string): void {
    clearTimeout(this.#timer);
    this.#status.textContent = text;
  }
}

/** Adds a layer to a map; settles when its manifest is read or rejected. */
function addLayer(layer: ImageLayer, map: Map3D): Promise<void> {
  return new Promise((resolve, reject) => {
    layer.once("ready", () => resolve()).once("error", ({ error }) => reject(error));
    layer.addTo(map);
  });
}

function fitToLayer(map: Map3D, { rendering }: ImageLayer): void {
  if (!rendering) return;
  const {
    origin,
    box: [low, high],
  } = rendering.json;
  map.fitBounds([add(origin, low), add(origin, high)]);
}

/** Returns the dropped files, or the dropped folder. The entries must be read before the event ends. @throws FilesError */
function filesOf({ items, files }: DataTransfer): Promise<Iterable<File> | Folder> {
  const entries = Array.from(items, (item) => item.webkitGetAsEntry()).filter((entry) => entry !== null);
  if (entries.length === 0) return Promise.resolve([...files]);
  return new DroppedEntries(entries).findFolders().then((folders) => {
    const [folder, ...more] = folders.values();
    if (!folder) throw new FilesError("none");
    if (more.length > 0)
      throw new FilesError(
        "several",
        [...folders.keys()].map((path) => path + MANIFEST),
      );
    return folder;
  });
}

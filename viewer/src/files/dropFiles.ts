import { addPanelButton } from "../core/panelButton";
import { adoptStyles, element, iconButton } from "../core/dom";
import { asError } from "../core/errors";
import { add } from "../core/vec";
import { MapLayer, imageLayer, type ImageLayerOptions, type map } from "../map3d";
import { FilesError, filesSource, named } from "./filesSource";
import { Dropped, MANIFEST, type Folder } from "./folder";
import { STYLES } from "./styles";
import { getFilesMessages } from "./i18n";

/** Of a `dropFiles`. */
export interface DropOptions {
  /** BCP 47. Default the map's. */
  language?: string;
  /** A button that opens the browser's file chooser. Default true. */
  button?: boolean;
  /** What takes drops. Default the map; a page around it may lie over its edges. */
  target?: HTMLElement;
  /** Of the layer that is made. */
  layer?: ImageLayerOptions;
  /** A layer of the map whose place the first files take. Default none: they are shown with what is there. */
  instead?: imageLayer;
}

/** What a `dropFiles` fires. */
export interface DropEvents {
  /** A rendering has been dropped or chosen; it is on the map. */
  dropped: { layer: imageLayer };
  /** Files that cannot be shown; the map is as before. Said beside the button, too. */
  error: { error: Error };
}

const FOLDER = "M3 7a2 2 0 0 1 2-2h4l2 2h8a2 2 0 0 1 2 2v8a2 2 0 0 1-2 2H5a2 2 0 0 1-2-2zM12 10.5v5M9.5 13h5";
const SHOWN_MS = 12_000;

/** Shows renderings from files: a published folder that is dropped on the map, or chosen. The next one takes the place of the one before. */
export class dropFiles extends MapLayer<map, DropEvents> {
  readonly options: DropOptions;
  readonly #said = element("p", "map3d-status", { role: "status" });
  readonly #input = element("input", "", { type: "file", multiple: "", webkitdirectory: "", hidden: "", tabindex: "-1" });
  readonly #over = element("div", "map3d-drop", { "aria-hidden": "true" });
  #box: HTMLElement | undefined;
  #ending = new AbortController();
  #layer: imageLayer | undefined;
  #asked = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(options: DropOptions = {}) {
    super();
    this.options = options;
    this.#input.addEventListener("change", () => {
      void this.#take(Promise.resolve([...(this.#input.files ?? [])]));
      this.#input.value = "";
    });
  }

  /** The rendering that was opened last; undefined before. */
  get layer(): imageLayer | undefined {
    return this.#layer;
  }

  /** Shows files as if they had been dropped. @throws FilesError, ManifestError or what else is wrong with them; the map is as before */
  async open(files: Iterable<File> | Folder): Promise<imageLayer> {
    const at = ++this.#asked;
    const source = filesSource(files);
    await source.manifest();
    const map = this.map;
    if (!map || at !== this.#asked) throw new DOMException("other files were opened meanwhile, or the map is gone", "AbortError");
    const [before, layer] = [this.#layer ?? this.options.instead, new imageLayer(source, this.options.layer)];
    before?.remove();
    if (map.layers.length === 0) map.resetView();
    try {
      await shown(layer, map);
    } catch (reason) {
      layer.remove();
      before?.addTo(map);
      throw reason;
    }
    this.#layer = layer;
    fit(map, layer);
    this.fire("dropped", { layer });
    return layer;
  }

  protected onAdd(map: map): void {
    adoptStyles(document, STYLES);
    const words = getFilesMessages(this.options.language ?? map.language);
    this.#over.textContent = words.drop;
    this.#input.setAttribute("aria-label", words.open);
    map.container.append(this.#over, this.#input);
    if (this.options.button ?? true) {
      const button = iconButton("", words.open, FOLDER);
      button.addEventListener("click", () => { this.#input.click(); });
      this.#box = addPanelButton(map, button, this.#said);
    }
    this.#ending = new AbortController();
    this.#listen(this.options.target ?? map.container, this.#ending.signal);
  }

  protected onRemove(): void {
    this.#asked++;
    this.#ending.abort();
    this.#say("");
    for (const part of [this.#box, this.#over, this.#input]) part?.remove();
    this.#layer?.remove();
    this.#layer = undefined;
  }

  #listen(target: HTMLElement, signal: AbortSignal): void {
    const over = (on: boolean): void => { this.#over.toggleAttribute("data-over", on); };
    const listen = (type: "dragenter" | "dragover" | "drop", act: (event: DragEvent) => void): void => {
      target.addEventListener(type, (event) => {
        if (event.dataTransfer?.types.includes("Files") === true) act(event);
      }, { signal });
    };
    for (const type of ["dragenter", "dragover"] as const) {
      listen(type, (event) => {
        event.preventDefault();
        if (event.dataTransfer) event.dataTransfer.dropEffect = "copy";
        over(true);
      });
    }
    target.addEventListener("dragleave", ({ relatedTarget }) => {
      if (!target.contains(relatedTarget as Node | null)) over(false);
    }, { signal });
    listen("drop", (event) => {
      event.preventDefault();
      over(false);
      if (event.dataTransfer) void this.#take(filesOf(event.dataTransfer));
    });
  }

  async #take(files: Promise<Iterable<File> | Folder>): Promise<void> {
    this.#say("");
    try {
      await this.open(await files);
    } catch (reason) {
      const error = asError(reason);
      if (error.name !== "AbortError") this.#failed(error);
    }
  }

  #failed(error: Error): void {
    const words = getFilesMessages(this.options.language ?? this.map?.language ?? "en");
    this.#say(error instanceof FilesError ? words[error.problem](named(error.paths)) : `${words.failed}: ${error.message}`);
    this.#timer = setTimeout(() => { this.#say(""); }, SHOWN_MS);
    this.fire("error", { error });
  }

  #say(text: string): void {
    clearTimeout(this.#timer);
    this.#said.textContent = text;
  }
}

/** Puts a layer on a map; settles when its manifest has been taken or refused. */
function shown(layer: imageLayer, map: map): Promise<void> {
  return new Promise((resolve, reject) => {
    layer.once("ready", () => { resolve(); }).once("error", ({ error }) => { reject(error); });
    layer.addTo(map);
  });
}

function fit(map: map, { rendering }: imageLayer): void {
  if (!rendering) return;
  const { origin, box: [low, high] } = rendering.json;
  map.fitBounds([add(origin, low), add(origin, high)]);
}

/** What was dropped. Folders have to be asked for before the event ends. @throws FilesError */
function filesOf({ items, files }: DataTransfer): Promise<Iterable<File> | Folder> {
  const entries = Array.from(items, (item) => item.webkitGetAsEntry()).filter((entry) => entry !== null);
  if (entries.length === 0) return Promise.resolve([...files]);
  return new Dropped(entries).search().then((found) => {
    const [folder, ...more] = found.values();
    if (!folder) throw new FilesError("none");
    if (more.length > 0) throw new FilesError("several", [...found.keys()].map((path) => path + MANIFEST));
    return folder;
  });
}
